"""Maps, waveforms and optimal cycles of the vibro-impact drive, computed before a run."""
