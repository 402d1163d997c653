"""What an interrupted command ends with; a file of its own so that it can be said before anything else is loaded."""

INTERRUPTED = 130
INTERRUPTION = "interrupted: no result was written"
