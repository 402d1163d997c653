"""What the motion can show at all."""
