"""Sensors and localisation."""
