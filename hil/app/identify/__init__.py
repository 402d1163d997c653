"""`capsule close-loop` and `capsule predict`."""
