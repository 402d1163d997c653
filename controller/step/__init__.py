"""The controller as C: one function from fresh readings to the limited command, and its use from Python."""
