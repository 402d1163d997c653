"""Effects of the drive: lag, play, dead zone, grip."""
