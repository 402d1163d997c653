"""`capsule campaign`: many closed loops, on processes or a cluster."""
