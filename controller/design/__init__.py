"""Design of a rig's classical controllers: tuning, margins, limit cycles."""
