"""A carriage that is a moteus controller: its frames, its actuator, and a simulated one."""
