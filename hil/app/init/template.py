"""A template record of each kind of rig, simulated, and the rig that its experimenter believes in."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from hil.app.init.rig_file import Tables
from models.files.record import Array, Record, read_record
from models.files.rig import parse_rig
from models.identification.kinds import kind_for
from models.identification.kinds.axis.coordinates import TURN
from plant.experiments.series import make_series

_SECONDS: Final = 12.0  # of a template record
_PULL_M_S: Final = 5e-4  # of paper A
Columns = Mapping[str, Array]


def template(kind: str, *, rotary: bool = False) -> tuple[Tables, Columns]:
    """Tables of a rig file of `kind` (with `rotary` of an axis that turns) and the columns of a simulated record of
    such a rig, the same at every call.
    """
    if rotary:
        return _turning_axis(np.random.default_rng(1))
    return _MADE[kind](np.random.default_rng(1)) if kind in _MADE else _series(kind)


def _series(kind: str) -> tuple[Tables, Columns]:
    """The plant alone: stick and slip, numbers that differ from the nominal ones, noise; 100 rows a second."""
    with TemporaryDirectory() as name:
        folder = make_series(kind, None, 1, Path(name), _SECONDS)
        tables = tomllib.loads((folder / "rig.toml").read_text(encoding="utf-8"))
        return tables, read_record(folder / "train_1.csv.gz", parse_rig(tables)).columns


def _axis(rng: np.random.Generator) -> tuple[Tables, Columns]:
    """Moves at two paces, and the force of mass and friction that differ from the nominal ones, with noise."""
    t, x, v, a = _swings((0.05, 0.01))
    force = 95.0 * a + 210.0 * v + 22.0 * np.sign(v) + 0.5 * rng.standard_normal(t.size)
    nominal = {"mass_kg": 100.0, "viscous_friction_N_s_per_m": 200.0, "coulomb_friction_N": 20.0, "offset_N": 0.0}
    return {"rig": {"kind": "axis"}, "axis": nominal}, {"t_s": t, "position_m": x, "force_N": force}


def _turning_axis(rng: np.random.Generator) -> tuple[Tables, Columns]:
    """The same of a joint that turns by one and a half radians."""
    t, x, v, a = _swings((0.7, 0.1))
    torque = 0.38 * a + 1.25 * v + 2.1 * np.sign(v) + 0.05 * rng.standard_normal(t.size)
    nominal = dict(zip(TURN.base, (0.4, 1.2, 2.0, 0.0), strict=True))
    return {"rig": {"kind": "axis"}, "axis": nominal}, {"t_s": t, "angle_rad": x, "torque_N_m": torque}


def _swings(sizes: tuple[float, float]) -> tuple[Array, Array, Array, Array]:
    """Time, position, speed and acceleration of 20 s of a slow swing and a fast one, of these sizes."""
    t = np.arange(0, 20, 2e-3)
    turns = 2 * np.pi * np.array([[0.2], [0.5]])
    size = np.array(sizes)[:, None]
    x = np.sum(size * (1 - np.cos(turns * t)), axis=0)
    v, a = np.sum(size * turns * np.sin(turns * t), axis=0), np.sum(size * turns**2 * np.cos(turns * t), axis=0)
    return t, x, v, a


def _periods(rng: np.random.Generator) -> tuple[Tables, Columns]:
    """Eight periods about the means that Zhang et al. (2016), Table 2, state for 0.5 mm/s."""
    means = {"period_s": 0.0912, "valley_N": 22.7e-3, "peak_N": 35.1e-3}
    rows = {name: mean * (1 + 0.03 * rng.standard_normal(8)) for name, mean in means.items()}
    return {"rig": {"kind": "periods", "velocity_m_s": _PULL_M_S}}, rows


def _dma(rng: np.random.Generator) -> tuple[Tables, Columns]:
    """A spectrum of the papers' five-element wall with the scatter of readings."""
    frequencies = np.geomspace(0.1, 50, 12)
    blank = {name: np.ones(12) for name in ("storage_modulus_Pa", "loss_modulus_Pa")}
    return _imitated({"rig": {"kind": "dma"}}, {"frequency_Hz": frequencies, **blank}, rng)


def _friction(rng: np.random.Generator) -> tuple[Tables, Columns]:
    """Twelve speeds over two decades under three loads, three readings each, with the Stribeck curve of a lubricated
    contact and 2 % of scatter.
    """
    v, load = (np.repeat(a.ravel(), 3) for a in np.meshgrid(np.geomspace(2e-4, 2e-2, 12), (0.1, 0.2, 0.5)))
    force = 0.09 * load * (1 + 0.5 * np.exp(-v / 2e-3)) * (1 + 0.02 * rng.standard_normal(v.size))
    tables: Tables = {"rig": {"kind": "friction"}, "contact": {"friction_coefficient": 0.1}}
    return tables, {"velocity_m_s": v, "load_N": load, "force_N": force}


def _vibro_table(rng: np.random.Generator) -> tuple[Tables, Columns]:
    """Runs of a capsubot on a plate at seven periods and three duties, two each."""
    tables: Tables = {
        "rig": {"kind": "vibro_table"},
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
    blank = {"cycles": np.full(len(runs["duty"]), 20.0), "mean_velocity_m_s": np.zeros(len(runs["duty"]))}
    return _imitated(tables, {**runs, **blank}, rng)


def _imitated(tables: Tables, columns: Columns, rng: np.random.Generator) -> tuple[Tables, Columns]:
    """The measured columns as the nominal model gives them with the noise that the kind expects."""
    record = Record("template", tables["rig"]["kind"], dict(columns))
    kind = kind_for(parse_rig(tables), [])
    return tables, kind.imitate(record, kind.nominal(), rng).columns


_MADE: Final[Mapping[str, Callable[[np.random.Generator], tuple[Tables, Columns]]]] = {
    "axis": _axis,
    "periods": _periods,
    "friction": _friction,
    "dma": _dma,
    "vibro_table": _vibro_table,
}
