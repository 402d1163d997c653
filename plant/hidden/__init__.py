"""What a simulated rig has beyond the base model, each effect in a form of its own."""
