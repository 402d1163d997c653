"""The seed papers' numbers: what each paper states, what its equations give here, what was measured, and the
verdict.
"""

from hil.app.papers.command import seeds
from hil.app.papers.row import Row
from hil.app.papers.table import seed_rows

__all__ = ["Row", "seed_rows", "seeds"]
