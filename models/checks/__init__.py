"""Records looked at before anything is fitted to them: one check a file, found in the folders below.

A function `check_...(view)` in `instrument/` (what the sensor did), `clock/` (time stamps), `wiring/` (signs, units,
delays) or `information/` (what the motion can show) takes a `View` of one record and returns its findings.
"""
