"""Kinds of rig, one declaration each; reading, checks, docs, `capsule init` and reports follow from it."""
