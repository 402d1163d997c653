"""A carriage that is a CiA 402 drive: protocol, set-up, homing, and how it is led."""
