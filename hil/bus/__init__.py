"""The bus: frames from the DBC, fast codec, protection, load, and a bus in simulated time."""
