"""A linear stage: inverse dynamics."""
