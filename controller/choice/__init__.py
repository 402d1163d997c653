"""Which model and controller lead: the closed loop in every model that the records leave possible, compared."""
