"""The controller as a node: receive, estimate, command, guard."""
