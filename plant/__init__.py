"""What is true in simulation: exact stick and slip, drives, sensors, anatomy, effects unknown to the model."""
