"""The seed papers' numbers: what each paper states, what its equations give here, what was measured, and the verdict."""

from hil.app.seeds.command import seeds
from hil.app.seeds.row import Row
from hil.app.seeds.table import seed_rows

__all__ = ["Row", "seed_rows", "seeds"]
