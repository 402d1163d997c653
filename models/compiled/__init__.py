"""The assembled model as machine code."""
