"""Which candidates are fitted on to the whole records, and which end on the way."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter, Growth
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.candidates import eliminate
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig, read_rig
from models.theta import Theta
from tests.plant.series import make_series


def test_a_candidate_that_leaves_far_more_than_the_first_ends_on_its_way(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 2, tmp_path, 16.0)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / "train_1.csv.gz", rig)]
    kind = SeriesKind.from_rig(rig, records)
    nominal = Theta.declared(p for p in kind.base if p.fit)

    def ended(behind: float) -> tuple[set[str], int]:
        names = ("incline_gravity", "actuator_lag")
        growths = {name: Growth(Fitter.of(kind, records, [name]), [nominal]) for name in names}
        return set(eliminate(records, growths, moved, behind)), growths["actuator_lag"].fits[0].count

    assert ended(6.0)[0] == {"incline_gravity"}
    everyone, whole = ended(np.inf)
    assert everyone == {"incline_gravity", "actuator_lag"}
    assert ended(2.0)[1] < 0.4 * whole, (
        "lost where the first one is at the noise: no further than five of sixteen seconds"
    )


def moved(name: str, share: float) -> None:
    """Nobody looks on."""


@pytest.fixture
def made(rig_text: str) -> tuple[SeriesKind, Record]:
    """16 s behind a magnet in which nothing moves, and its kind."""
    t = np.arange(0, 16.0, 0.002)
    record = Record("made", "magnetic", {"t_s": t, "carriage_position_m": 0 * t, "position_m": 0 * t})
    return SeriesKind.from_rig(parse_rig(tomllib.loads(rig_text)), [record]), record


@dataclass
class Stated(Growth):
    """Leaves the stated mean square of so many numbers, at every length."""

    leaves: float = 1.0
    count: int = 100

    def on(self, number: int, records: Sequence[Record]) -> list[Fit]:
        """Looks for nothing."""
        self.fits = [Fit(Theta(), self.count * self.leaves, self.count, np.zeros((1, 0)), np.ones(1))]
        return self.fits


def stated(kind: SeriesKind, record: Record, leaves: dict[str, float], count: int = 100) -> dict[str, Stated]:
    """Growths of single effects with what each leaves."""
    fitters = {name: Fitter.of(kind, [record], [name]) for name in leaves}
    return {name: Stated(fitters[name], [Theta()], leaves=left, count=count) for name, left in leaves.items()}


def test_declared_look_alikes_of_the_first_few_stay_where_rivals_that_leave_less_would_put_them_out(
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
        "stribeck": 6.5,
    }
    growths = stated(kind, record, leaves)
    assert set(eliminate([record], growths, moved, 6.0)) == set(leaves) - {"stribeck"}
    growths["directional_asymmetry"].leaves = 21.0
    assert "directional_asymmetry" not in eliminate([record], growths, moved, 6.0)


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
        return set(eliminate([record], stated(kind, record, leaves, count), moved, 6.0))

    assert set(leaves) - ended(5) == {"actuator_lag"}
    assert set(leaves) - ended(100) == {"actuator_lag", "incline_gravity"}
