"""Series that a search has once named wrongly, or named with far more than noise left; a few numbers make each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copy
from typing import Final

import numpy as np

from models.files.toml import toml_text
from plant.experiments.examples import BELIEVED
from plant.experiments.scenario import write_record
from plant.tables import Floats
from tests.places import SHARED
from tests.plant.series import RECORDS

LAG: Final = SHARED / "reference" / "series" / "magnetic_lag"
_FINER: Final = 10  # samples that the plant gives for each row of an uneven record


@dataclass(frozen=True)
class Localiser:
    """A poor instrument: noise in the unit of what is measured, rows at a rate uneven by 20 %, 2 % of them missing."""

    std: float
    rate_Hz: float


@dataclass(frozen=True)
class Case:
    """A series: kind and `hidden` numbers of the plant, `seed` of its rig and records, or a record of the shared series
    with a lag. `right` are the effects that may be named, none where nothing is hidden.
    """

    kind: str
    hidden: Mapping[str, Mapping[str, float]]
    right: tuple[str, ...]
    seed: int = 0
    poor: Localiser | None = None
    record: int = 0
    seconds: float = 45.0

    def make(self, out: Path) -> list[Path]:
        """Write the series to `out` with its rig file; the training records, one held out as `holdout.csv.gz`."""
        out.mkdir(parents=True, exist_ok=True)
        if self.record:
            copy(LAG / "rig.toml", out)
            return [Path(copy(LAG / f"train_{self.record}.csv.gz", out))]
        if self.kind == "axis":
            rig = '[rig]\nkind = "axis"\n\n[noise]\ntorque_std_N_m = 0.05\n'
            makers: list[Callable[[], Floats]] = [lambda k=k: joint(self.seed + k, self.hidden) for k in range(4)]
        else:
            rig, makers = self._plant()
        (out / "rig.toml").write_text(rig, encoding="utf-8")
        for name, make in zip(RECORDS, makers, strict=True):
            write_record(out / f"{name}.csv.gz", make())
        return [out / f"{name}.csv.gz" for name in RECORDS if name != "holdout"]

    def _plant(self) -> tuple[str, list[Callable[[], dict[str, Floats]]]]:
        belief = BELIEVED[self.kind]
        first, *streams = (np.random.default_rng(s) for s in np.random.SeedSequence(self.seed).spawn(1 + len(RECORDS)))
        truth = replace(belief.truth(first), hidden={name: dict(own) for name, own in self.hidden.items()})
        usual = 1e-3 if belief.pulled else 5e-5
        share = self.poor.std / usual if self.poor else 1.0
        rate = _FINER * self.poor.rate_Hz if self.poor else 500.0

        def record(rng: np.random.Generator) -> dict[str, Floats]:
            columns = belief.record(truth, rng, self.seconds, share, rate)
            return uneven(columns, rng) if self.poor else columns

        return toml_text(belief.tables(share)), [lambda rng=rng: record(rng) for rng in streams]


def uneven(columns: dict[str, Floats], rng: np.random.Generator) -> dict[str, Floats]:
    """A tenth of the rows, at times uneven by 20 % of the interval to either side, 2 % of them missing."""
    rows = np.arange(_FINER, columns["t_s"].size - _FINER, _FINER)
    rows = rows[rng.random(rows.size) > 0.02]
    rows += rng.integers(-_FINER // 5, _FINER // 5 + 1, rows.size)
    return {name: values[np.concatenate([[0], rows])] for name, values in columns.items()}


def joint(seed: int, hidden: Mapping[str, Mapping[str, float]], seconds: float = 20.0) -> dict[str, Floats]:
    """A record of a joint: inertia, friction and offset; with `gravity` a weight, with `stribeck` friction that falls
    with speed, with `load` friction that grows with the logged load; the form of the fall is not the catalogue's.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 2e-3)
    turns = 2 * np.pi * np.array([0.11, 0.29, 0.61])[:, None] * rng.uniform(0.8, 1.2, (3, 1))
    size, phase = np.array([[0.9], [0.35], [0.12]]), rng.uniform(0, 2 * np.pi, (3, 1))
    x = np.sum(size * np.sin(turns * t + phase), axis=0)
    v = np.sum(size * turns * np.cos(turns * t + phase), axis=0)
    a = np.sum(-size * turns**2 * np.sin(turns * t + phase), axis=0)
    weight = hidden.get("gravity", {}).get("torque_N_m", 0.0) * np.sin(x - 0.4)
    load = np.abs(weight) + 3.0 * (1 + np.sin(0.7 * t + phase[0]))
    level = 1 + hidden.get("load", {}).get("growth_per_N_m", 0.0) * load
    fall = hidden.get("stribeck", {"excess": 0.0, "speed_rad_s": 1.0})
    level = level * (1 + fall["excess"] / (1 + (v / fall["speed_rad_s"]) ** 2))
    torque = 0.4 * a + (1.2 * v + 2.0 * np.sign(v)) * level + 0.2 + weight
    return {"t_s": t, "angle_rad": x, "torque_N_m": torque + 0.05 * rng.standard_normal(t.size), "load_N_m": load}


_LAGS: Final = ("actuator_lag",)
_PLAY: Final = {"carriage_backlash": {"width_m": 1.5e-3}}
_JOINT: Final = {
    "gravity": {"torque_N_m": 8.0},
    "stribeck": {"excess": 0.6, "speed_rad_s": 0.15},
    "load": {"growth_per_N_m": 0.08},
}
CASES: Final[dict[str, Case]] = {
    "lag_1": Case("magnetic", {}, _LAGS, record=1),
    "lag_2": Case("magnetic", {}, _LAGS, record=2),
    "lag_3": Case("magnetic", {}, _LAGS, record=3),
    "asymmetry": Case(
        "pull", {"directional_asymmetry": {"excess": 0.18, "speed_m_s": 3e-4}}, ("directional_asymmetry",), 71
    ),
    "asymmetry_back": Case(
        "pull", {"directional_asymmetry": {"excess": -0.18, "speed_m_s": 1e-4}}, ("directional_asymmetry",), 72
    ),
    "grip": Case(
        "coil",
        {"coupling_decay": {"share": 0.3, "length_m": 12e-3}},
        ("coupling_decay", "coupling_profile"),
        73,
        seconds=20.0,
    ),
    "coil_folds": Case(
        "coil",
        {"fold_periodic": {"excess": 0.25, "wavelength_m": 7e-3, "phase_rad": 1.0}},
        ("fold_periodic",),
        74,
        seconds=20.0,
    ),
    "voltage": Case("coil_voltage", {}, (), 75, seconds=20.0),
    "voltage_2": Case("coil_voltage", {}, (), 76, seconds=20.0),
    "joint": Case("axis", _JOINT, ("gravity_over_angle", "stribeck", "load_dependent_friction"), 77),
    "play": Case("magnetic", _PLAY, ("carriage_backlash",), 78, Localiser(5e-4, 100.0)),
    "play_fine": Case("magnetic", _PLAY, ("carriage_backlash",), 79, Localiser(3e-4, 200.0)),
    "play_coarse": Case("magnetic", _PLAY, ("carriage_backlash",), 80, Localiser(1e-3, 30.0)),
    "play_pull": Case("pull", _PLAY, ("carriage_backlash",), 81, Localiser(4e-3, 200.0)),
}
