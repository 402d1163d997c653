"""The seed papers' laws, one file each, written once for NumPy arrays and CasADi symbols."""
