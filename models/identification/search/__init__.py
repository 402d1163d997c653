"""The search for what the model lacks: screening, candidates, growing horizon, selection."""
