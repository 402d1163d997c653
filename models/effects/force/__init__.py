"""Effects that are forces on the capsule."""
