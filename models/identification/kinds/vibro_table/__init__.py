"""Mean speeds of a vibro-impact drive over its drive parameters."""
