"""Scenarios, drive profiles and the records that they give."""
