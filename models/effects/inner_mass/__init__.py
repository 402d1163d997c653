"""Effects of an inner mass on its spring."""
