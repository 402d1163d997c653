"""What the capsule lies on: the gut or a plate."""
