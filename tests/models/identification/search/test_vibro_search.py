"""The inner mass in the gut through the loop's parts: made-up series, the free run against the plant, what a short
record tells.
"""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.effects import CATALOGUE
from models.effects.inner_mass import EndStopImpact
from models.effects.refinements import DAMPING_KNOTS_M_S, DampingOverSpeed
from models.identification.fitting.fit import judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.screening import screen
from models.identification.settings import SET
from models.records.record import Record, read_record
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from tests.plant.series import make_series

CANDIDATES = ("spring_damping", "stribeck", "incline_gravity")


def read_series(folder: Path) -> tuple[Rig, list[Record], dict[str, float]]:
    """Rig file, records and the true numbers that a calibration looks for."""
    rig = read_rig(folder / "rig.toml")
    answer = tomllib.loads((folder / "answer.toml").read_text())
    return rig, [read_record(folder / f"{name}.csv.gz", rig) for name in ("train_1", "train_2")], answer


@pytest.mark.parametrize("name", ["coil", "vibro", "vibro_plate"])
def test_a_series_is_what_its_model_leaves_noise_of(name: str, tmp_path: Path) -> None:
    """At the true numbers the free run leaves the sensor's noise (50 um) and little else; at the nominal ones more than
    that.
    """
    rig, records, answer = read_series(make_series(name, None, 2, tmp_path, 4.0))  # type: ignore[arg-type]
    kind = kind_for(rig, records)
    truth = kind.nominal() | {key: value for key, value in answer.items() if key in kind.nominal()}
    left = [
        float(np.mean(kind.residual(records[0], theta, kind.criteria - 1) ** 2)) for theta in (truth, kind.nominal())
    ]
    assert left[0] < 1.2
    assert left[1] > 2 * left[0]


@pytest.mark.parametrize("name", ["coil", "vibro", "vibro_plate"])
def test_an_observer_leaves_no_more_than_the_free_run_at_the_truth(name: str, tmp_path: Path) -> None:
    """A body that no command holds in place tells nothing of the wall by being off it: an observer that moved the wall
    left up to 26 times the noise. What remains is the one noisy sample from which it starts.
    """
    rig, records, answer = read_series(make_series(name, None, 1, tmp_path, 4.0))  # type: ignore[arg-type]
    kind = kind_for(rig, records)
    truth = kind.nominal() | {key: value for key, value in answer.items() if key in kind.nominal()}
    for stage in range(kind.criteria - 1):
        assert float(np.mean(kind.residual(records[0], truth, stage) ** 2)) < 1.3


def test_hidden_damping_of_the_spring_stands_out_in_the_gut(tmp_path: Path) -> None:
    """The loop's own parts on one short record: a calibration is not enough; of all candidates damping, fitted jointly
    with the base, leaves the least, and little: the screen alone sees it from a base that is bent to make up for it,
    and where that ends hangs on rounding.
    """
    rig, records, _ = read_series(make_series("vibro", "spring_damping", 3, tmp_path, 2.0))
    full = kind_for(rig, records)
    assert isinstance(full, SeriesKind)
    kind, part = replace(full, effects=tuple(CATALOGUE[name] for name in CANDIDATES)), records[:1]
    base = Fitter.of(kind, part, []).far([kind.nominal()]).theta
    left = judged_cost(kind, part, base)
    assert left > SET.near
    fits = {
        row.effect: Fitter.of(kind, part, [row.effect]).far([kind.nominal().with_(row.effect, row.starts[0])]).theta
        for row in screen(kind, part, [], base)
    }
    costs = {name: judged_cost(kind, part, fit) for name, fit in fits.items()}
    assert min(costs, key=lambda name: costs[name]) == "spring_damping"
    assert costs["spring_damping"] < 1 + 0.2 * (left - 1)  # 1 is the noise
    assert fits["spring_damping"]["spring_damping", "damping_N_s_per_m"] > 0.1


def test_a_calibration_is_enough_in_the_gut_where_nothing_hides(tmp_path: Path) -> None:
    rig, records, answer = read_series(make_series("vibro", None, 3, tmp_path, 3.0))
    kind = kind_for(rig, records)
    base = Fitter.of(kind, records, []).far([kind.nominal()]).theta
    assert judged_cost(kind, records, base) < 1.3
    for name in ("force_N", "spring_stiffness_N_per_m"):
        assert base[name] == pytest.approx(answer[name], rel=0.02)


def test_a_stop_takes_energy_and_never_pulls() -> None:
    p = {"stiffness_N_per_m": 1e4, "gap_m": 2e-3, "loss_s": 1e-3}
    stop = EndStopImpact()
    assert stop.suspension(1.9e-3, 5.0, p) == 0
    assert stop.suspension(2.5e-3, 0.3, p) > stop.suspension(2.5e-3, 0.0, p) == pytest.approx(5.0)
    assert stop.suspension(2.5e-3, -3.0, p) == 0
    assert stop.suspension(-2.5e-3, -0.3, p) == pytest.approx(-stop.suspension(2.5e-3, 0.3, p))


def test_a_curve_of_damping_goes_through_its_knots() -> None:
    p = {f"c_{k}": 0.1 * k for k in range(1, len(DAMPING_KNOTS_M_S))}
    curve = DampingOverSpeed()
    for k, rate in enumerate(DAMPING_KNOTS_M_S[1:], start=1):
        assert curve.suspension(0.0, -rate, p) == pytest.approx(-0.1 * k * rate)
    assert curve.suspension(0.0, 0.15, p) == pytest.approx(0.15 * 0.15)
    assert curve.suspension(0.0, 2.0, p) == pytest.approx(0.4 * 2.0)
    assert curve.suspension(0.0, 0.0, p) == 0
