"""`capsule convert`: files of other programs and logs to files that this one or another reads."""
