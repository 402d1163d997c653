"""A carriage that is a CiA 402 drive: states, mapping, set-up, simulation."""
