"""Scenario and deployment files: what is run, and with which model."""
