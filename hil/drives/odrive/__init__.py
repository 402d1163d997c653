"""A carriage that is an ODrive: protocol, set-up, and how it is led."""
