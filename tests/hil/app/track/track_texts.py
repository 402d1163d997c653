"""A short track scenario as text."""

SHORT = """
[scenario]
name = "short"
duration_s = 2.0
[rig]
kind = "magnetic"
[reference]
kind = "ramp"
speed_mm_s = 2.0
"""
