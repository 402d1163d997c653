"""Nodes on the bus: the controller with its guard, the operator's sender, and the frame map of each kind of rig."""
