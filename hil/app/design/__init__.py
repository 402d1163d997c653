"""`capsule design`: linear design and drive maps."""
