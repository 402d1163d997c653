"""The vibro-impact drive's own choice of waveform: speed map, optimal cycles, feedforward, slow loop."""
