"""The kinds of rig that the loop from residual to effect knows, one file each."""
