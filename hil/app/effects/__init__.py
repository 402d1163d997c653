"""`capsule effects`: the catalogue of effects, and the conformance checks on a user's own."""
