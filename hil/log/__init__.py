"""Logs of CAN frames: written by a process of their own, read back, and turned into records."""
