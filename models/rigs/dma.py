"""A sample of the wall in a dynamic test: its frequency is driven, both moduli are measured."""

import numpy as np

from models.rigs.columns import Columns
from models.rigs.kind import Record, RigKind, Tables


def _template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """A spectrum of the papers' five-element wall with the scatter of readings."""
    return {"rig": {"kind": DMA.id}}, {"frequency_Hz": np.geomspace(0.1, 50, 12)}


DMA = RigKind(
    id="dma",
    layouts=(Columns((("frequency_Hz",),), ("storage_modulus_Pa", "loss_modulus_Pa"), time=False, minimum=3),),
    template=_template,
    wanted="more samples or frequencies",
    hooks=frozenset({"modulus"}),
    signals=frozenset(),
)
