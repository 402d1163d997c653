"""Effects that scale the friction."""
