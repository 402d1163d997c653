"""The seed papers' numbers: stated by the paper, computed from its equations, measured; and the verdict."""
