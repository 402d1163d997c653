"""`capsule export`: plants and found models in forms that other programs read."""
