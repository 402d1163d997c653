"""The seed papers' numbers: what each paper states, what its equations give here, what was measured, and the
verdict.
"""

from hil.app.papers.command import seed_rows, seeds
from hil.app.papers.row import Row

__all__ = ["Row", "seed_rows", "seeds"]
