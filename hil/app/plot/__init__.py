"""`capsule plot`: pictures of records."""
