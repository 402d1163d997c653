"""Periods and force limits of the stick-slip saw-tooth."""
