"""Periods of stick and slip of a capsule that is drawn at one speed: how long each lasts, its valley and its peak."""

from typing import Any

import numpy as np

from models.rigs.columns import SLOWEST_PULL, Columns
from models.rigs.kind import Record, RigKind, Tables
from models.rigs.rig import Head
from models.rigs.tables import PaperCapsuleTable, PaperTissueTable

_PULL_M_S = 5e-4  # of paper A


class PeriodsHead(Head):
    """`[rig]` with the speed, where it is no column."""

    velocity_m_s: float | None = None

    def check(self) -> None:
        speed = self.velocity_m_s
        if speed is not None and not SLOWEST_PULL <= speed <= 1:
            raise ValueError(
                f"[rig] velocity_m_s must be the speed of the pull, {SLOWEST_PULL:g} to 1 m/s; got {speed:g}"
            )

    def parts(self, nested: Any) -> dict[str, Any]:
        return {"name": self.name, "velocity_m_s": self.velocity_m_s}


def _template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Eight periods about the means that Zhang et al. (2016), Table 2, state for 0.5 mm/s."""
    means = {"period_s": 0.0912, "valley_N": 22.7e-3, "peak_N": 35.1e-3}
    rows = {name: mean * (1 + 0.03 * rng.standard_normal(8)) for name, mean in means.items()}
    return {"rig": {"kind": PERIODS.id, "velocity_m_s": _PULL_M_S}}, rows


PERIODS = RigKind(
    id="periods",
    layouts=(Columns((), ("period_s", "valley_N", "peak_N"), time=False, minimum=3, given_by_rig=("velocity_m_s",)),),
    usual={"period_s": (1e-3, 60.0, "s"), "valley_N": (0.0, 5.0, "N"), "peak_N": (1e-4, 5.0, "N")},
    head=PeriodsHead,
    tables={"capsule": PaperCapsuleTable, "tissue": PaperTissueTable},
    template=_template,
    wanted="more periods",
    rising=("valley_N", "peak_N"),
    scatters=True,
    hooks=frozenset({"stiffening", "wall_force"}),
    signals=frozenset({"v", "direction", "drag", "drag_rate"}),
)
