"""`capsule track`: the closed loop without a bus."""
