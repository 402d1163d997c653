"""Estimators: the state of the capsule from late, noisy and sometimes wrong measurements."""
