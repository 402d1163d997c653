"""A carriage that is an ODrive: its actuator, and a simulated one."""
