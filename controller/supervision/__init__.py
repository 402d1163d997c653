"""Which controller is in charge, when the model changes, and what a new one must pass."""
