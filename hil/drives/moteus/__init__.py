"""A carriage that is a moteus controller: protocol, set-up, and how it is led."""
