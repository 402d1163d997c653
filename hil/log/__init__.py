"""Logs of CAN frames: written by a separate process, read back, and converted to records."""
