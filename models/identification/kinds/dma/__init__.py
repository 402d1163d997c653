"""Dynamic moduli over frequency."""
