"""A fit that begins with a few teeth of stick and slip: it finds the truth from far off."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from models.identification.fitting.fit import Fit, evaluate
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.growing_horizon import QUICK, GrowingHorizon, base_known, eliminate
from models.identification.search.refit import whole
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig, read_rig
from models.theta import Theta
from tests.plant.series import make_series


def test_a_base_and_a_force_far_off_are_found(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 2, tmp_path, 30.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2)]
    kind = SeriesKind.from_rig(rig, records)
    nominal = Theta.declared(p for p in kind.base if p.fit)
    start = nominal | {("incline_gravity", "force_N"): 0.002}
    found = GrowingHorizon(kind, ["incline_gravity"], [start], QUICK, "incline_gravity").over(records)
    assert found.chi2 < 1.1
    for name in nominal:
        assert found.theta[name] == pytest.approx(answer[name], rel=0.01)
    mass_kg = 4.0e-3
    weight_N = -mass_kg * 9.81 * np.sin(answer["parameters"]["angle_rad"])
    assert found.theta["incline_gravity", "force_N"] == pytest.approx(weight_N, rel=0.02)


def test_it_never_ends_worse_than_where_it_was_told_to_start(tmp_path: Path) -> None:
    folder = make_series("magnetic", None, 3, tmp_path, 12.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / "train_1.csv.gz", rig)]
    kind = SeriesKind.from_rig(rig, records)
    truth = Theta.of((p.key, float(answer[p.name])) for p in kind.base if p.fit)
    r = evaluate(kind, records, truth, kind.free_run)
    assert GrowingHorizon(kind, [], [truth], QUICK).over(records).cost <= float(r @ r)


def test_effects_that_a_model_has_are_fitted_with_its_base_and_are_no_candidates(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 1, tmp_path, 6.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / "train_1.csv.gz", rig)]
    plain = kind_for(rig, records)
    force_N = -4.0e-3 * 9.81 * np.sin(answer["parameters"]["angle_rad"])
    kind = kind_for(rig, records, {("incline_gravity", "force_N"): (0.8 * force_N, np.inf)})
    assert {e.id for e in plain.effects} - {e.id for e in kind.effects} == {"incline_gravity"}
    assert plain.predict(records[0], kind.nominal()) == pytest.approx(kind.predict(records[0], kind.nominal()))
    found = whole(kind, records, [], kind.nominal())
    assert found.theta["incline_gravity", "force_N"] == pytest.approx(force_N, rel=0.05)


def test_a_base_is_known_where_a_prior_holds_all_of_it(tmp_path: Path) -> None:
    rig = read_rig(make_series("magnetic", None, 1, tmp_path, 1.0) / "rig.toml")
    nominal = Theta.declared(p for p in kind_for(rig, []).base if p.fit)
    assert not base_known(kind_for(rig, []))
    assert base_known(kind_for(rig, [], {name: (value, 0.01 * value) for name, value in nominal.items()}))
    first = next(iter(nominal))
    assert not base_known(kind_for(rig, [], {n: (v, (0.1 if n == first else 0.01) * v) for n, v in nominal.items()}))


def test_a_base_that_is_known_is_left_as_it_is_however_much_it_leaves(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 2, tmp_path, 3.0)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / "train_1.csv.gz", rig)]
    kind = SeriesKind.from_rig(rig, records)
    known = replace(kind, base=tuple(replace(p, fit=False) for p in kind.base))
    fit = whole(known, records, [], known.nominal())
    assert fit.chi2 > 10
    assert not fit.theta


def test_a_candidate_that_leaves_far_more_than_the_first_ends_on_its_way(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 2, tmp_path, 16.0)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / "train_1.csv.gz", rig)]
    kind = SeriesKind.from_rig(rig, records)
    nominal = Theta.declared(p for p in kind.base if p.fit)

    def ended(behind: float) -> tuple[set[str], int]:
        climbs = {
            name: GrowingHorizon(kind, [name], [nominal], QUICK, name) for name in ("incline_gravity", "actuator_lag")
        }
        return set(eliminate(records, climbs, 3, behind)), climbs["actuator_lag"].fits[0].count

    assert ended(6.0)[0] == {"incline_gravity"}
    everyone, whole = ended(np.inf)
    assert everyone == {"incline_gravity", "actuator_lag"}
    assert ended(2.0)[1] < 0.4 * whole, (
        "lost where the first one is at the noise: no further than five of sixteen seconds"
    )


@pytest.fixture
def made(rig_text: str) -> tuple[SeriesKind, Record]:
    """16 s behind a magnet in which nothing moves, and its kind."""
    t = np.arange(0, 16.0, 0.002)
    record = Record("made", "magnetic", {"t_s": t, "carriage_position_m": 0 * t, "position_m": 0 * t})
    return SeriesKind.from_rig(parse_rig(tomllib.loads(rig_text)), [record]), record


@dataclass
class Told(GrowingHorizon):
    """Leaves what it is told for each of its numbers, at every length."""

    leaves: float = 1.0
    count: int = 100

    def on(self, number: int, length: float, records: Sequence[Record]) -> None:
        """Looks for nothing."""
        self.fits = [Fit(Theta(), self.count * self.leaves, self.count, np.zeros((1, 0)), np.ones(1))]


def test_declared_look_alikes_of_the_first_stay_where_rivals_that_leave_less_would_put_them_out(
    made: tuple[SeriesKind, Record],
) -> None:
    """Behind a magnet a force, a bias and an asymmetry leave much the same: only the last fit tells, if any."""
    kind, record = made
    leaves = {
        "incline_gravity": 3.4,
        "peristaltic_wave": 4.3,
        "sensor_bias": 4.7,
        "directional_asymmetry": 6.4,
        "respiration": 6.5,
    }
    climbs = {name: Told(kind, [name], [Theta()], QUICK, leaves=cost) for name, cost in leaves.items()}
    assert set(eliminate([record], climbs, 3, 6.0)) == set(leaves) - {"respiration"}
    climbs["directional_asymmetry"].leaves = 21.0
    assert "directional_asymmetry" not in eliminate([record], climbs, 3, 6.0)


def test_one_that_leaves_no_more_than_chance_stays_beside_others_with_more_parameters(
    made: tuple[SeriesKind, Record],
) -> None:
    """Over a second there are five numbers: folds, with five of their own, leave next to nothing of them."""
    kind, record = made
    leaves = {
        "fold_periodic": 0.2,
        "preconditioning": 0.3,
        "stenosis": 0.4,
        "incline_gravity": 1.8,
        "actuator_lag": 6.0,
    }

    def ended(count: int) -> set[str]:
        climbs = {name: Told(kind, [name], [Theta()], QUICK, leaves=left, count=count) for name, left in leaves.items()}
        return set(eliminate([record], climbs, 3, 6.0))

    assert set(leaves) - ended(5) == {"actuator_lag"}
    assert set(leaves) - ended(100) == {"actuator_lag", "incline_gravity"}
