"""`capsule run`, `replay` and `plant`: real time on a bus."""
