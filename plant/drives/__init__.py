"""How force reaches the capsule: imposed position, one driven body, or a body with an inner mass."""
