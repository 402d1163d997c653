"""The program: a folder a command."""
