"""The catalogue of faults and their injection."""
