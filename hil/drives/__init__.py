"""Drives of other makers as the catalogue's carriage: table, set-up and bus of each."""
