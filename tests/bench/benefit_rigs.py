"""What the bench of benefit runs: rigs drawn at random by their number, a lab's first two records, and two references.

Of 15 rigs 8 have a magnet, 4 a coil that is driven by a voltage, 3 an inner mass. Their base differs from the rig file
by up to 15 %. One of four has nothing hidden, the others one effect in the plant's own form; one of 13 is the model of
one gut in another: recorded over folds, then driven where they are elsewhere, absent, or half a wavelength further.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from models.files.toml import toml_text
from plant.experiments.examples import BELIEVED, POSITION_SPAN_M, POSITION_STD_M, Believed
from plant.experiments.profile import Profile, Pwm, Runs, SineProfile, pulse_width
from plant.experiments.scenario import RunTable, Scenario, parse_truth, record_scenario, write_record
from plant.sensing import Sensor
from plant.tables import Floats
from tests.plant.series import draw

Tables = dict[str, Any]
Hidden = dict[str, dict[str, float]]
RECORDS: Final = ("first.csv", "second.csv")
RIG: Final = "rig.toml"
KINDS: Final = ("magnetic",) * 8 + ("coil",) * 4 + ("vibro",) * 3
CLEAN_OF: Final = 4
OTHER_OF: Final = 13
OTHERS: Final = ("elsewhere", "none", "shifted")
_PUSHED: Final = (
    "actuator_lag", "fold_periodic", "stenosis", "tissue_drying", "dwell_adhesion", "directional_asymmetry",
    "viscous_drag", "coupling_fade", "lumen_taper", "incline_gravity",
)  # fmt: skip
EFFECTS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "magnetic": (*_PUSHED, "carriage_backlash"),
        "coil": _PUSHED,
        "vibro": (
            "spring_damping", "end_stop_impact", "driver_lag", "fold_periodic", "stenosis", "tissue_drying",
            "directional_asymmetry", "viscous_drag", "lumen_taper", "incline_gravity",
        ),
    }
)  # fmt: skip
_BELIEVED: Final = {"magnetic": "magnetic", "coil": "coil_voltage", "vibro": "vibro"}
LEAST_WAY_M: Final = 8e-3
"""A lab turns up the voltage until a coil moves the capsule so far."""
STEP_S: Final = {"magnetic": 20e-6, "coil": 20e-6, "vibro": 5e-6}
"""Of the plant while it is recorded: the edges of pulses need a short one."""


@dataclass(frozen=True)
class Levels:
    """A coil's voltage: each of `volts` one way for `run_s`, a rest, the other way, a rest, in turn; edges of 0.1 s."""

    volts: tuple[float, ...]
    run_s: float
    rest_s: float

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        steps = [(sign * v, s) for v in self.volts for sign in (1.0, -1.0) for s in (self.run_s, -self.rest_s)]
        turn = np.concatenate([np.full(round(abs(s) / dt), v if s > 0 else 0.0) for v, s in steps])
        values, edge = np.resize(turn, round(duration_s / dt) + 1), round(0.1 / dt)
        sums = np.cumsum(np.concatenate([np.zeros(edge), values]))
        return np.asarray((sums[edge:] - sums[:-edge]) / edge)


@dataclass(frozen=True)
class Trains(Pwm):
    """Pulses for `run_s` at `duty`, a rest, pulses at what is left to 1, which lead back, a rest, in turn."""

    run_s: float = 2.0
    rest_s: float = 0.5

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        rest = np.zeros(round(self.rest_s / dt))
        trains = [pulse_width(self.period_s, duty, self.run_s, dt)[:-1] for duty in (self.duty, 1 - self.duty)]
        turn = np.concatenate([part for train in trains for part in (train, rest)])
        return np.asarray(np.resize(turn, round(duration_s / dt) + 1))


Motion = tuple[Profile, float]
"""What a lab drives, and for how long in s."""


@dataclass(frozen=True)
class DrawnRig:
    """A rig by its `number`: what hides while it is `recorded` and while it is `driven`, the numbers of its base as
    `shares` of the rig file's, its localisation, how a lab moves it, and the tables [reference] with how long each is.
    """

    number: int
    kind: str
    other: str
    recorded: Hidden
    driven: Hidden
    shares: dict[str, float]
    localisation: dict[str, float]
    motions: tuple[Motion, Motion]
    references: tuple[tuple[Tables, float], ...]

    @property
    def believed(self) -> Believed:
        return BELIEVED[_BELIEVED[self.kind]]

    def rig_file(self) -> Tables:
        """What the lab believes."""
        return self.believed.tables(self.localisation["std"] / POSITION_STD_M)

    def truth_tables(self, hidden: Hidden) -> Tables:
        """The true rig in the tables of a scenario."""
        nominal, share = self.believed.nominal, self.shares
        drive = {key: getattr(nominal.drive, own) * share[key] for key, own in nominal.drive.calibrated.items()}
        tables: Tables = {
            "capsule": {name: getattr(nominal.capsule, name) for name in ("mass_kg", "radius_m", "cylinder_length_m")},
            "tissue": {
                "friction_coefficient": nominal.tissue.friction_coefficient * share["friction_coefficient"],
                "hoop_stress_factor": share["hoop_stress_factor"],
            },
            "rig": {"kind": self.kind},
            "effects": hidden,
        }
        if self.kind == "magnetic":
            tables["rig"] |= {**vars(nominal.drive), **drive}
        elif self.kind == "coil":
            gain = drive["coil_force_N_per_A"]
            tables["drive"] = {**vars(nominal.drive), "gain_N_per_A": gain, "back_emf_V_s_per_m": gain}
        else:
            own = ("inner_mass_kg", "spring_damping_N_s_per_m", "reaction_on_body")
            tables["drive"] = {name: getattr(nominal.drive, name) for name in own} | drive
        return tables

    def base(self) -> dict[str, float]:
        """The numbers of the true base by the names of a model."""
        nominal = self.believed.nominal
        names = {"friction_coefficient": nominal.tissue.friction_coefficient, "hoop_stress_factor": 1.0}
        names |= {key: getattr(nominal.drive, own) for key, own in nominal.drive.calibrated.items()}
        return {name: value * self.shares[name] for name, value in names.items()}

    def scenario(self, reference: int) -> Tables:
        """SCENARIO.toml of a reference: the truth in its own tables, the lab's rig file in [belief]."""
        table, seconds = self.references[reference]
        belief = {name: content for name, content in self.rig_file().items() if name != "noise"}
        return {
            "scenario": {"name": f"rig {self.number}", "duration_s": seconds, "seed": self.number + 1},
            **self.truth_tables(self.driven),
            "localisation": self.localisation,
            "reference": table,
            "belief": belief,
        }

    def write_records(self, folder: Path) -> None:
        """The rig file and the two records."""
        (folder / RIG).write_text(toml_text(self.rig_file()), encoding="utf-8")
        sensor = Sensor(self.localisation["rate_Hz"], self.localisation["std"], span=POSITION_SPAN_M)
        for seed, (name, (profile, seconds)) in enumerate(zip(RECORDS, self.motions, strict=True)):
            columns = self.record(profile, self.recorded, seconds, sensor, seed)
            while self.kind == "coil" and np.ptp(columns["position_m"]) < LEAST_WAY_M:
                profile = louder(profile)
                columns = self.record(profile, self.recorded, seconds, sensor, seed)
            write_record(folder / name, columns)

    def record(self, profile: Profile, hidden: Hidden, seconds: float, sensor: Sensor, seed: int) -> dict[str, Floats]:
        """A record of the true rig in the columns that the lab logs."""
        run = RunTable("", seconds, 2 * self.number + seed, STEP_S[self.kind])
        truth = parse_truth({**self.truth_tables(hidden), "scenario": vars(run)})[2]
        columns = record_scenario(Scenario(run, self.kind, truth, profile, sensor))
        return {name: values for name, values in columns.items() if name not in self.believed.unlogged}

    def rich(self, seed: int) -> dict[str, Floats]:
        """A record of the rig as it is driven, for the model that is right: 30 s at 200 Hz, 50 um rms."""
        return self.record(
            self.believed.profile, self.driven, 30.0, Sensor(200.0, POSITION_STD_M, span=POSITION_SPAN_M), 100 + seed
        )


def louder(profile: Profile) -> Profile:
    """A coil's voltage turned up by a sixth."""
    if isinstance(profile, SineProfile):
        return replace(profile, amplitude_V=profile.amplitude_V * 7 / 6)
    assert isinstance(profile, Levels)
    return replace(profile, volts=tuple(v * 7 / 6 for v in profile.volts))


def drawn(number: int) -> DrawnRig:
    """The rig of this number, whatever other rigs there are."""
    rng, (kind, other, clean) = np.random.default_rng([58, number]), _dealt(number)
    effect = "fold_periodic" if other else _effect(number, kind)
    recorded: Hidden = {} if clean else {effect: draw(effect, rng)}
    names = ("friction_coefficient", "hoop_stress_factor", *BELIEVED[_BELIEVED[kind]].nominal.drive.calibrated)
    shares = {name: float(rng.uniform(0.85, 1.15)) for name in names}
    localisation = {
        "std": float(rng.uniform(0.05e-3, 0.3e-3)),
        "rate_Hz": float(rng.choice([100.0, 200.0, 500.0])),
        "latency_s": float(rng.uniform(2e-3, 20e-3)),
    }
    driven = other_gut(other, recorded, rng) if other else recorded
    motions, references = MOVES[kind](rng)
    return DrawnRig(number, kind, other, recorded, driven, shares, localisation, motions, references)


def _dealt(number: int) -> tuple[str, str, bool]:
    """Kind, other gut, and whether nothing hides."""
    if number % OTHER_OF == OTHER_OF - 1:
        return "magnetic", OTHERS[number // OTHER_OF % len(OTHERS)], False
    block = np.random.default_rng([15, number // len(KINDS)]).permutation(len(KINDS))
    clean = np.random.default_rng([4, number // CLEAN_OF]).integers(CLEAN_OF) == number % CLEAN_OF
    return KINDS[block[number % len(KINDS)]], "", bool(clean)


def _effect(number: int, kind: str) -> str:
    """The effect of a rig: each of its kind's in turn, shuffled, before one comes again."""
    turn = sum(_dealt(k) == (kind, "", False) for k in range(number))
    deck = EFFECTS[kind]
    order = np.random.default_rng([list(EFFECTS).index(kind), turn // len(deck)]).permutation(len(deck))
    return deck[order[turn % len(deck)]]


def other_gut(other: str, folds: Hidden, rng: np.random.Generator) -> Hidden:
    """What hides in the other gut than that of `folds`."""
    if other == "none":
        return {}
    if other == "elsewhere":
        return {"fold_periodic": draw("fold_periodic", rng)}
    numbers = folds["fold_periodic"]
    return {"fold_periodic": {**numbers, "phase_rad": numbers["phase_rad"] + np.pi}}


References = tuple[tuple[Tables, float], ...]
Moves = tuple[tuple[Motion, Motion], References]


def _seconds(rng: np.random.Generator) -> float:
    return round(float(rng.uniform(8.0, 40.0)), 1)


def _speeds(rng: np.random.Generator, low: float, high: float) -> tuple[float, ...]:
    """One speed or two."""
    return tuple(float(v) for v in rng.uniform(low, high, int(rng.integers(1, 3))))


def _references(rng: np.random.Generator, way_mm: float, before: tuple[float, ...], fastest: float) -> References:
    """Two that no record is like: to two places off the ends of the way at a speed more than a quarter off those
    `before`; and through five places, two of them beyond the start, each leg at another speed. About 12 s each.
    """
    speed = fastest
    for _ in range(20):
        speed = float(rng.uniform(0.4 * fastest, fastest))
        if all(abs(speed / v - 1) > 0.25 for v in before):
            break
    ends = [round(way_mm * float(share), 2) for share in (rng.uniform(1.2, 1.5), rng.uniform(0.2, 0.5))]
    travel_mm = 2 * ends[0] - ends[1]
    speed = max(speed, travel_mm / 11.0)
    steps = {"kind": "steps", "positions_mm": ends, "speed_mm_s": round(speed, 3), "dwell_s": 0.8}
    places = way_mm * np.array([0.6, 0.35, 1.3, -0.25, -0.1]) * rng.uniform(0.8, 1.2, 5)
    legs = np.abs(np.diff([0.0, *places])) / (fastest * rng.uniform(0.3, 0.9, 5)) + rng.choice([0.0, 0.5], 5)
    times = [round(0.5 + float(t), 3) for t in np.cumsum(legs * min(1.0, 12.0 / legs.sum()))]
    points = {
        "kind": "waypoints",
        "times_s": [0.5, *times],
        "positions_mm": [0.0, *(round(float(p), 2) for p in places)],
    }
    return (steps, round(travel_mm / speed + 2.6, 1)), (points, round(times[-1] + 0.6, 1))


def _magnet(rng: np.random.Generator) -> Moves:
    way_m, rest_s, speeds = float(rng.uniform(8e-3, 20e-3)), float(rng.uniform(0.3, 1.5)), _speeds(rng, 1e-3, 6e-3)
    turn = [leg for v in speeds for leg in ((v, way_m / v), (0.0, rest_s), (-v, way_m / v), (0.0, rest_s))] * 20
    back_and_forth = Runs(tuple(v for v, _ in turn), tuple(s for _, s in turn))
    sine = SineProfile(float(rng.uniform(0.05, 0.25)), amplitude_m=0.5 * way_m)
    motions = (back_and_forth, _seconds(rng)), (sine, _seconds(rng))
    return motions, _references(rng, 1e3 * way_m, tuple(1e3 * v for v in speeds), 8.0)


def _coil(rng: np.random.Generator) -> Moves:
    volts = tuple(v * (1 + 0.2 * k) for k, v in enumerate([1.5] * int(rng.integers(1, 3))))
    levels = Levels(volts, float(rng.uniform(1.0, 3.0)), float(rng.uniform(0.3, 1.5)))
    sine = SineProfile(float(rng.uniform(0.1, 0.5)), amplitude_V=1.7)
    return ((levels, _seconds(rng)), (sine, _seconds(rng))), _references(rng, float(rng.uniform(10.0, 20.0)), (), 8.0)


def _inner_mass(rng: np.random.Generator) -> Moves:
    def trains() -> Trains:
        duty, rest_s = 0.5 - float(rng.uniform(0.12, 0.3)), float(rng.uniform(0.3, 1.0))
        return Trains(float(rng.uniform(0.045, 0.07)), duty, run_s=float(rng.uniform(1.0, 3.0)), rest_s=rest_s)

    motions = (trains(), _seconds(rng)), (trains(), _seconds(rng))
    return motions, _references(rng, float(rng.uniform(25.0, 40.0)), (), 12.0)


MOVES: Final = {"magnetic": _magnet, "coil": _coil, "vibro": _inner_mass}
