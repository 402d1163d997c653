"""Where plant and controller meet: bus, nodes, logs and the command line."""
