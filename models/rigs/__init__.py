"""Kinds of rig, one file and one declaration each; reading, checks, docs, `capsule init` and reports follow from it."""
