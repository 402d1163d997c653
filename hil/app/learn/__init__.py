"""Learning while a controller leads: what was logged since the model broke, identified in the background."""
