"""Drives of other makers in the place of the catalogue's carriage: how each is declared, set up and led."""
