"""Time stamps as they were logged."""
