"""A simulated rig: the bus medium, the plant behind its drive, simulated drives of other makers, and faults."""
