"""What the drive of an axis does to its force is found in forms that are not the catalogue's."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray

from models.identification import close
from models.identification.finding import Finding
from models.records.record import Record, record_of
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig

Floats = NDArray[np.float64]
RIG = parse_rig({"rig": {"kind": "axis", "driven": "force_N"}, "noise": {"position_std_m": 2e-4}})
STEP, FINE = 4e-3, 400
Hidden = Callable[[Floats], Floats]
"""The force that arrives of a commanded one, both every 10 us."""


@njit
def pushed(force: Floats, step: float) -> Floats:
    """The place of 5 kg with 3 N and 20 N s/m of friction, whose impulse is clipped to what would stop it."""
    x, v, out = 0.0, 0.0, np.empty(force.size)
    for k in range(force.size):
        out[k] = x
        free, stop = v + step / 5 * (force[k] - 0.3), step / 5 * (3 + 20 * abs(v))
        v = math.copysign(max(abs(free) - stop, 0.0), free)
        x += step * v
    return out


def command(seed: int, seconds: float = 8.0) -> Floats:
    """Steps and tones of up to 30 N after a rest, every 4 ms."""
    rng, t = np.random.default_rng(seed), np.arange(0, seconds, STEP)
    tones = sum(w * np.sin(2 * math.pi * f * t + rng.uniform(0, 6)) for w, f in ((8, 0.37), (5, 1.1), (4, 2.9)))
    steps = np.repeat(rng.uniform(-12, 12, t.size // 50 + 1), 50)[: t.size]
    return np.where(t < 0.16, 0.0, tones + steps)


def record(hidden: Hidden, seed: int) -> Record:
    u = command(seed)
    place = pushed(hidden(np.repeat(u, FINE)), STEP / FINE)[::FINE]
    noisy = place + 2e-4 * np.random.default_rng(seed).standard_normal(u.size)
    return record_of(f"run_{seed}", {"t_s": STEP * np.arange(u.size), "position_m": noisy, "force_N": u}, RIG)


def closed(hidden: Hidden) -> Finding:
    return close(RIG, [record(hidden, 1), record(hidden, 2)], [record(hidden, 3)], lambda stage, share: None)[0]


def plain(u: Floats) -> Floats:
    return u


@njit
def late(u: Floats) -> Floats:
    """Two lags in series, of 12 and 5 ms."""
    out, once, twice = np.empty(u.size), u[0], u[0]
    for k in range(u.size):
        once += 1e-5 / 0.012 * (u[k] - once)
        twice += 1e-5 / 0.005 * (once - twice)
        out[k] = twice
    return out


def limited(u: Floats) -> Floats:
    """A hyperbolic tangent that ends at 14 N."""
    return 14 * np.tanh(u / 14)


def clipped(u: Floats) -> Floats:
    """A current's limit."""
    return np.clip(u, -13.0, 13.0)


def dead(u: Floats) -> Floats:
    """Nothing below some 3 N, with soft edges."""
    return np.asarray(np.sign(u) * 0.7 * np.log1p(np.exp((np.abs(u) - 3) / 0.7)))


def test_a_faithful_drive_lacks_nothing() -> None:
    finding = closed(plain)
    assert (finding.verdict, finding.effects) == ("none", ())


@pytest.mark.parametrize(
    ("hidden", "effect"),
    [
        (late, "actuator_lag"),
        (limited, "actuator_saturation"),
        (clipped, "actuator_saturation"),
        (dead, "actuator_dead_zone"),
    ],
    ids=["two_lags", "tanh", "limit", "soft_dead_zone"],
)
def test_what_a_drive_does_to_its_force_is_found(hidden: Hidden, effect: str) -> None:
    finding = closed(hidden)
    assert [found.id for found in finding.effects][:1] == [effect]
    held = finding.error["holdout"]
    assert held["augmented"] < 0.5 * held["calibrated"]


def by_current(seed: int, axis: dict[str, float]) -> tuple[Rig, Record]:
    """A record of the current whose 4.2 N/A push a faithful drive."""
    rig = parse_rig({"rig": {"kind": "axis", "driven": "coil_current_A"}, "axis": axis})
    made = record(plain, seed)
    columns = {name: made[name] for name in ("t_s", "position_m")} | {"coil_current_A": made["force_N"] / 4.2}
    return rig, record_of(made.name, columns, rig)


def test_an_unknown_constant_is_calibrated_by_the_stated_mass() -> None:
    (rig, first), (_, second) = (by_current(seed, {"mass_kg": 5.0}) for seed in (1, 2))
    assert "follows from the stated mass_kg" in first.notes[0]
    finding, model = close(rig, [first], [second], lambda stage, share: None)
    constant = finding.calibration["force_constant_N_per_A"]
    assert constant.ci95[0] < 4.2 < constant.ci95[1]
    assert constant.ci95[1] - constant.ci95[0] < 0.8
    assert finding.calibration["coulomb_friction_N"].value == pytest.approx(3.0, rel=0.05)
    predicted = model.predict(rig, second)["position_m"]
    assert np.sqrt(np.mean((predicted - second["position_m"]) ** 2)) < 0.02 * np.ptp(second["position_m"])


def test_without_mass_and_constant_one_sentence_says_which_must_be_stated() -> None:
    with pytest.raises(ValueError, match="or else mass_kg or inertia_kg_m2, where coil_current_A drives"):
        by_current(1, {})
