"""How force reaches the capsule: pull, magnetic, coil, vibro; one file each."""
