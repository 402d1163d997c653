"""What stands in for a rig: the medium, the plant behind its drive, the drives' doubles, and faults."""
