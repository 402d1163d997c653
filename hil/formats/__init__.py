"""Files of other programs and instruments: one reader per format."""
