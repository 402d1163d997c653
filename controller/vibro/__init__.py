"""The controller of an inner mass: waveforms, their drive map, and the slow loop around it."""
