"""Classical controllers to compare with."""
