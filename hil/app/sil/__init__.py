"""`capsule sil`: the closed loop over the simulated bus, with faults."""
