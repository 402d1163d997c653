"""A table of runs of a body that an inner mass shakes along a plate: period and duty are driven, the mean speed is
measured.
"""

import numpy as np

from models.rigs.columns import Columns
from models.rigs.kind import Record, RigKind, Tables
from models.rigs.tables import BodyTable, DriveTable, SurfaceTable


def _template(rng: np.random.Generator) -> tuple[Tables, Record]:
    """Runs of a capsubot on a plate at seven periods and three duties, two each."""
    tables: Tables = {
        "rig": {"kind": VIBRO_TABLE.id},
        "capsule": {"mass_kg": 0.193},
        "drive": {
            "inner_mass_kg": 0.074,
            "spring_stiffness_N_per_m": 256.23,
            "force_N": 1.25,
            "reaction_on_body": True,
        },
        "surface": {"kind": "plate", "friction_coefficient": 0.29},
    }
    periods, duties = np.meshgrid(np.arange(0.05, 0.116, 0.011), (0.2, 0.5, 0.8))
    runs = {"period_s": np.repeat(periods.ravel(), 2), "duty": np.repeat(duties.ravel(), 2)}
    return tables, {**runs, "cycles": np.full(len(runs["duty"]), 20.0)}


VIBRO_TABLE = RigKind(
    id="vibro_table",
    layouts=(Columns((("period_s",), ("duty",), ("cycles",)), ("mean_velocity_m_s",), time=False, minimum=4),),
    usual={"mean_velocity_m_s": (0.0, 1.0, "m/s")},
    tables={"capsule": BodyTable, "drive": DriveTable, "surface": SurfaceTable},
    template=_template,
    longest_s=1e5,
    wanted="runs at more pairs of period_s and duty",
    runs=True,
    hooks=frozenset({"suspension", "reach", "link", "gain", "modulus"}),
)
