"""One way to fit: from close by, and from anywhere, however far its valley lies from the first descent's."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.effects.force import Respiration
from models.effects.friction import FoldPeriodic
from models.identification.fitting.fit import evaluate
from models.identification.fitting.fitter import Fitter, Growth
from models.identification.kinds import kind_for, ready
from models.identification.kinds.series.series import SeriesKind
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig, read_rig
from models.theta import Theta
from tests.plant.series import make_series
from tests.rig_texts import GUT

FOLDS, BREATH = FoldPeriodic.id, Respiration.id
SHAPE = (FOLDS, "second_sin")


def pulled(seed: int, folder: Path, seconds: float) -> tuple[SeriesKind, list[Record], dict[str, float]]:
    """Clean pulls of quiet noise, their kind and the truth."""
    folder = make_series("pull", None, seed, folder, seconds, 0.3)
    rig, truth = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text())
    train = [ready(read_record(folder / f"train_{k}.csv.gz", rig), rig) for k in (1, 2, 3)]
    kind = kind_for(rig, train)
    assert isinstance(kind, SeriesKind)
    return kind, train, {name: truth[name] for name in ("hoop_stress_factor", "friction_coefficient")}


@pytest.mark.parametrize("seed", [602381001])
def test_a_clean_pull_is_calibrated_to_the_truth(tmp_path: Path, seed: int) -> None:
    """From the nominal friction alone least squares ends at 0.086 instead of 0.073 here."""
    kind, train, truth = pulled(seed, tmp_path, 12.0)
    found = Fitter.of(kind, kind.searched(train), []).far([kind.nominal()]).theta
    assert {name: found[name] for name in truth} == pytest.approx(truth, rel=5e-3)


@pytest.mark.parametrize(("hoop", "friction"), [(1.0, 0.1), (1.45, 0.05), (0.65, 0.05)])
def test_from_a_bad_start_a_short_pull_is_fitted_to_the_truth(tmp_path: Path, hoop: float, friction: float) -> None:
    """From close by it ends in another valley, with hundreds of times what the truth leaves."""
    kind, train, truth = pulled(5, tmp_path, 6.0)
    fitter = Fitter.of(kind, train[:1], [])
    bad = kind.nominal() | {"hoop_stress_factor": hoop, "friction_coefficient": friction}
    near, far = fitter.near(bad), fitter.far([bad])
    assert near.chi2 > 100 * far.chi2
    assert {name: far.theta[name] for name in truth} == pytest.approx(truth, rel=5e-3)


def test_the_best_of_several_starts_counts_wherever_it_stands(tmp_path: Path) -> None:
    kind, train, truth = pulled(5, tmp_path, 6.0)
    fitter = Fitter.of(kind, train[:1], [])
    bad, good = kind.nominal() | {"hoop_stress_factor": 0.65, "friction_coefficient": 0.05}, Theta(truth)
    alone = fitter.far([good], seeds=0)
    for starts in ([bad, good], [good, bad]):
        assert fitter.far(starts, seeds=0).cost == alone.cost < 0.01 * fitter.far([bad], seeds=0).cost


@pytest.fixture
def folds() -> tuple[SeriesKind, Record, Theta]:
    """A pull to and fro over folds whose second harmonic is a third of the first, and the model that made it."""
    rig = parse_rig({"rig": {"kind": "pull"}, "noise": {"force_std_N": 1e-3}, **tomllib.loads(GUT)})
    t = np.arange(0, 12, 1e-2)
    driven = Record("to and fro", "pull", {"t_s": t, "position_m": 0.02 * np.sin(0.5 * t), "force_N": np.sin(t)})
    kind = kind_for(rig, [driven])
    assert isinstance(kind, SeriesKind)
    own = {**FoldPeriodic.start(), "depth": 0.3, SHAPE[1]: 0.33}
    theta = kind.nominal().with_(FOLDS, own)
    return kind, kind.imitate(driven, theta, np.random.default_rng(1)), theta


def test_a_plain_fit_leaves_harmonics_as_the_start_has_them(folds: tuple[SeriesKind, Record, Theta]) -> None:
    kind, record, theta = folds
    fitter = Fitter.of(kind, [record], [FOLDS])
    for shape in (0.33, -0.2):
        start = theta | {SHAPE: shape, (FOLDS, "depth"): 0.2, (FOLDS, "wavelength_m"): 0.0082}
        plain = fitter.plain().near(start)
        assert plain.theta[SHAPE] == shape
        assert plain.theta[FOLDS, "depth"] != 0.2
        assert plain.theta.keys() == theta.keys()
        whole = fitter.near(start)
        assert whole.theta[SHAPE] == pytest.approx(0.33, abs=0.02)
    grown = Growth(fitter.plain(), [theta]).over([record])
    assert grown[SHAPE] == 0.33
    assert plain.cost > 1.5 * whole.cost, "with the wrong harmonic"


def test_a_plain_fit_moves_size_kind_place_and_phase(folds: tuple[SeriesKind, Record, Theta]) -> None:
    kind, record, _ = folds
    moved = {axis.name for axis in Fitter.of(kind, [record], [FOLDS, BREATH, "stenosis"]).plain().axes}
    assert moved == {
        *(p.key for p in kind.base if p.fit),
        *((FOLDS, name) for name in ("depth", "wavelength_m", "phase_rad")),
        *((BREATH, name) for name in ("force_N", "frequency_Hz", "phase_rad")),
        *(("stenosis", name) for name in ("excess", "centre_m", "width_m")),
    }


def test_values_that_are_not_fitted_are_kept_and_count(folds: tuple[SeriesKind, Record, Theta]) -> None:
    """The record was made with another hoop stress than the nominal one, which is not fitted here."""
    kind, record, theta = folds
    true = theta | {"hoop_stress_factor": 1.2}
    record = kind.imitate(record, true, np.random.default_rng(2))
    held = replace(kind, base=tuple(replace(p, fit=p.fit and p.name != "hoop_stress_factor") for p in kind.base))
    fitter = Fitter.of(held, [record], [FOLDS])
    start = true | {"friction_coefficient": 0.99 * true["friction_coefficient"], ("stribeck", "excess"): 0.5}
    fit = fitter.near(start)
    assert fit.theta["hoop_stress_factor"] == 1.2
    assert fit.theta["friction_coefficient"] == pytest.approx(true["friction_coefficient"], rel=0.01)
    assert fit.chi2 < 1.2
    assert "stribeck" not in fit.theta.effects, "an effect that the model has not"
    assert fit.jacobian.shape == (fit.count, len(fitter.axes))
    nominal = fitter.near(start | {"hoop_stress_factor": 1.0})
    assert nominal.theta["hoop_stress_factor"] == 1.0
    assert nominal.chi2 > 1.5


def test_a_fit_of_nothing_is_the_start(folds: tuple[SeriesKind, Record, Theta]) -> None:
    kind, record, theta = folds
    held = replace(kind, base=tuple(replace(p, fit=False) for p in kind.base))
    fit = Fitter.of(held, [record], []).near(theta)
    assert fit.theta == theta.only(kind.in_base)
    assert fit.jacobian.shape == (fit.count, 0)


def test_the_lowest_of_many_points_are_those_of_their_costs(folds: tuple[SeriesKind, Record, Theta]) -> None:
    kind, record, theta = folds
    fitter = Fitter.of(kind, [record], [FOLDS])
    points = [theta | {(FOLDS, "depth"): depth} for depth in (0.1, 0.31, -0.2, 0.5, 0.29, 0.0, 0.6)]
    costs = fitter.costs(points)
    assert fitter.lowest(points, 3) == [points[k] for k in np.argsort(costs)[:3]]
    assert costs == pytest.approx([float(r @ r) for r in (evaluate(kind, [record], p, kind.free_run) for p in points)])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_effect_is_fitted_beyond_the_least_that_its_name_stands_for(
    folds: tuple[SeriesKind, Record, Theta], side: float
) -> None:
    """A wave that stands everywhere at once is a force in time: its number stays above the least, on either side."""
    kind, record, theta = folds
    breath = {**Respiration.start(), "force_N": 0.03}
    truth = theta.only(kind.in_base).with_(BREATH, breath)
    record = kind.imitate(record, truth, np.random.default_rng(3))
    start = theta.only(kind.in_base).with_("peristaltic_wave", {**breath, "wavenumber_per_m": 0.5 * side})
    wave = Fitter.of(kind, [record], ["peristaltic_wave"]).near(start)
    assert wave.theta["peristaltic_wave", "wavenumber_per_m"] == pytest.approx(3.5 * side, rel=1e-3)
    assert wave.cost > Fitter.of(kind, [record], [BREATH]).near(truth).cost
