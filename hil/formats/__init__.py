"""Files of other programs and instruments: one reader a format, all found through one table."""
