"""What a residual that no known effect explains depends on, and the term that is proposed for it."""
