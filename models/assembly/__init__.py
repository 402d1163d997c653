"""Surface + drive + effects -> one CasADi model."""
