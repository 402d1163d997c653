"""Files that users bring: rig files, records, TOML, their own Python."""
