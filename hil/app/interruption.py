"""What an interrupted command ends with; a file of its own so that it can be said before anything else is loaded."""

INTERRUPTED = 130  # exit status, as shells have it: 128 and SIGINT
INTERRUPTION = "interrupted: no result was written"
