"""Whether the model in use still holds, watched while it leads."""
