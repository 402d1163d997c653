"""A second encoder at the load of a driven axis shows what is between both: nothing, a spring, play."""

import math

import numpy as np
import pytest
from numba import njit

from models.identification import close
from models.identification.finding import Finding
from models.identification.kinds import kind_for
from models.records.record import Record, record_of
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.models.identification.kinds.test_drives_of_benches import FINE, RIG, STEP, Floats, command

LOAD = "load_position_m"
Numbers = tuple[float, float, float, float]
"""Stiffness in N/m^n, exponent n and half of the play in m of what couples 3 kg of drive to 2 kg of load, and the
load's own friction in N.
"""
RIGID, STIFFENS, LOOSE = (0.0, 1.0, 0.0, 0.0), (2e4, 1.15, 0.0, 0.0), (4e6, 1.5, 1e-3, 0.4)


@njit
def coupled(force: Floats, step: float, stiff: float, power: float, half: float, rub: float) -> tuple[Floats, Floats]:
    """Places of both masses; the contact loses energy as Hunt and Crossley's, and the load rubs on its frame."""
    x, v, y, w = 0.0, 0.0, 0.0, 0.0
    first, second = np.empty(force.size), np.empty(force.size)
    for k in range(force.size):
        first[k], second[k] = x, y
        e = x - y
        deep = max(abs(e) - half, 0.0)
        pull = math.copysign(max(stiff * deep**power * (1 + 12 * (v - w) * math.copysign(1, e)), 0.0), e)
        free, stop = v + step / 3 * (force[k] - pull), step / 3 * (3 + 20 * abs(v))
        v = math.copysign(max(abs(free) - stop, 0.0), free)
        w += step * (pull - rub * w / (abs(w) + 2e-3)) / 2
        x, y = x + step * v, y + step * w
    return first, second


def record(numbers: Numbers, seed: int, load: bool = True) -> Record:
    u, rng = command(seed), np.random.default_rng(seed)
    fine: tuple[Floats, Floats] = coupled(np.repeat(u, FINE), STEP / FINE, *numbers)
    place, behind = (one[::FINE] for one in (fine if numbers != RIGID else fine[:1] * 2))
    columns = {"t_s": STEP * np.arange(u.size), "position_m": place + 2e-4 * rng.standard_normal(u.size), "force_N": u}
    mounted = {LOAD: behind + 0.012 + 1e-4 * rng.standard_normal(u.size)} if load else {}
    return record_of(f"run_{seed}", columns | mounted, RIG)


def closed(numbers: Numbers, load: bool = True) -> Finding:
    records = [record(numbers, seed, load) for seed in (1, 2, 3)]
    return close(RIG, records[:2], records[2:], lambda stage, share: None)[0]


def test_the_load_is_where_its_drive_is_but_for_a_stretch() -> None:
    made = record(STIFFENS, 1)
    kind = kind_for(RIG, [made])
    assert kind.channels == ("position_m", LOAD)
    nominal, load = kind.nominal(), kind.alone(LOAD)
    place = kind.predict(kind.driven(made), nominal)
    assert np.array_equal(load.predict(kind.driven(made), nominal), place)
    spring = {"load_kg": 2.0, "frequency_Hz": 6.0, "damping": 0.1}
    theta = nominal | Theta.of((("elastic_drive", name), value) for name, value in spring.items())
    stretch = kind.predict(kind.driven(made), theta) - load.predict(kind.driven(made), theta)
    assert 1e-4 < np.max(np.abs(stretch)) < 0.05


def test_its_mounting_does_not_count_and_gaps_are_left_out() -> None:
    made = record(RIGID, 1)
    kind = kind_for(RIG, [made]).alone(LOAD)
    nominal = kind.nominal()
    moved = kind.residual(made.with_column(LOAD, made[LOAD] + 0.3), nominal)
    assert moved == pytest.approx(kind.residual(made, nominal), abs=1e-6)
    some = np.where(np.arange(len(made)) % 3, np.nan, made[LOAD])
    assert len(kind.residual(made.with_column(LOAD, some), nominal)) < 0.4 * len(moved)


def test_with_one_an_axis_is_run_from_its_measured_force() -> None:
    made = record(RIGID, 1)
    columns = {name: made[name] for name in ("t_s", "position_m", "force_N", LOAD)}
    read = record_of("run", columns, parse_rig({"rig": {"kind": "axis"}}))
    assert read.layout.measured == ("position_m",)
    assert "force_N drives and position_m is measured" in read.notes[0]


def test_without_anything_between_both_places_are_one() -> None:
    first, second = (record(RIGID, seed) for seed in (1, 2))
    finding, model = close(RIG, [first], [second], lambda stage, share: None)
    assert (finding.verdict, finding.effects) == ("none", ())
    predicted = model.predict(RIG, second)
    assert np.array_equal(predicted[LOAD], predicted["position_m"])
    assert finding.beside[LOAD].error["holdout"]["calibrated"] < 1.5 * finding.beside[LOAD].noise_floor


@pytest.mark.parametrize(("numbers", "effect"), [(STIFFENS, "elastic_drive"), (LOOSE, "drive_play")])
def test_it_shows_what_is_between(numbers: Numbers, effect: str) -> None:
    """A spring that stiffens is one of a class with a little play."""
    finding = closed(numbers)
    first = finding.effects[0]
    assert effect in {first.id, *first.equivalent}
    held = finding.beside[LOAD].error["holdout"]
    assert held["augmented"] < 0.5 * held["calibrated"]


def test_play_shows_in_the_place_of_the_drive_alone() -> None:
    finding = closed(LOOSE, load=False)
    assert [found.id for found in finding.effects][:1] == ["drive_play"]
