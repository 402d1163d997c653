"""`capsule check`."""
