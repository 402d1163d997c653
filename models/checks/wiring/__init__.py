"""Signs, units and delays between the columns."""
