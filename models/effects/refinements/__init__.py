"""Finer shapes of effects that are already named; never candidates."""
