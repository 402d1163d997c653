"""Measured records: read, checked against what their kind of rig needs, and mapped to our columns."""
