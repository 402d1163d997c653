"""`capsule jog`: steering by hand over the bus."""
