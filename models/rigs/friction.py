"""A steady contact: speed and load are driven, the friction force or its coefficient is measured."""

import numpy as np

from models.rigs.columns import Columns, Range
from models.rigs.kind import Record, RigKind, Tables
from models.rigs.tables import Contact


def _template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Twelve speeds over two decades under three loads, three readings each, with the Stribeck curve of a lubricated
    contact and 2 % of scatter.
    """
    v, load = (np.repeat(a.ravel(), 3) for a in np.meshgrid(np.geomspace(2e-4, 2e-2, 12), (0.1, 0.2, 0.5)))
    force = 0.09 * load * (1 + 0.5 * np.exp(-v / 2e-3)) * (1 + 0.02 * rng.standard_normal(v.size))
    tables: Tables = {"rig": {"kind": FRICTION.id}, "contact": {"friction_coefficient": 0.1}}
    return tables, {"velocity_m_s": v, "load_N": load, "force_N": force}


FRICTION = RigKind(
    id="friction",
    layouts=tuple(
        Columns((("velocity_m_s",),), (measured,), time=False, minimum=4, optional=("load_N",))
        for measured in ("force_N", "friction_coefficient")
    ),
    ranges={
        "velocity_m_s": Range(-1e3, 1e3, "between -1000 and 1000 m/s and not 0", zero=False),
        "force_N": Range(-1e6, 1e6, "between -1e6 and 1e6 N"),
        "load_N": Range(0.0, 1e9, "positive, at most 1e9 N", above=True),
    },
    usual={"velocity_m_s": (0.0, 20.0, "m/s"), "friction_coefficient": (1e-4, 10.0, "as a coefficient")},
    tables={"contact": Contact},
    template=_template,
    wanted="more speeds or loads",
    hooks=frozenset({"level", "force", "normal_load"}),
    signals=frozenset({"v", "direction", "load"}),
)
