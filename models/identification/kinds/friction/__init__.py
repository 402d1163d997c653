"""Steady friction of a contact over speed and load."""
