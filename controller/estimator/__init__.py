"""What the controller knows of the capsule, from late, noisy, at times wrong measurements."""
