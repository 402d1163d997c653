"""`capsule init`: the first files of one's own rig."""
