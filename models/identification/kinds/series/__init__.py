"""Time series of a capsule."""
