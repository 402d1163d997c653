"""What the sensor and its amplifier did to the signal."""
