"""FMI 3.0 Co-Simulation units."""
