"""Effects of the wall."""
