"""`capsule demo`: all examples in one command."""
