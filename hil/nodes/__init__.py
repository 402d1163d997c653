"""What sits on the bus: the controller with its guard, who steers by hand, and which frames are whose."""
