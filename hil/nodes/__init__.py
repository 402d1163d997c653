"""What sits on the bus: the controller with its guard, the drives, and the plant behind them."""
