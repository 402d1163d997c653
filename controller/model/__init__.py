"""The control model: one tick of a rig, differentiable and compiled."""
