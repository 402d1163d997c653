"""What is true in simulation: exact stick and slip, drives, sensors, anatomy, and effects that the model does not
know.
"""
