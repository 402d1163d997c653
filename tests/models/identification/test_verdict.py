"""What a finished search allows to say."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from models.checks.finding import RecordFinding
from models.effects.drive import CarriageBacklash
from models.effects.effect import Effect
from models.effects.force import Respiration, StressRelaxation
from models.effects.friction import FoldPeriodic, Preconditioning, Stenosis, Stribeck, TissueDrying
from models.identification.finding import Check, Fitted
from models.identification.fitting.fit import Fit, axes
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.rehearsal import Left
from models.identification.search.search import Search
from models.identification.verdict import (
    at_bounds,
    checks_of_model,
    periods_of,
    setback_findings,
    setbacks,
    unshown,
    verdict_of,
    within,
)
from models.records.record import Record
from models.rigs.rig import Rig
from models.rigs.tables import Noise
from models.theta import Theta
from tests.models.identification.kinds.axes import axis_kind

KIND = axis_kind(1.0, 2.0, 3.0, 0.1)
THETA = KIND.nominal()
TOLD = {name: Fitted(value, (0.9 * value, 1.1 * value)) for name, value in THETA.items()}
FOUND = THETA.with_(Stribeck.id, Stribeck.start()) | {("stribeck", "excess"): 0.5}
AMPLITUDE = Theta.of({("stribeck", "excess"): Fitted(0.5, (0.4, 0.6))})
HELD = {"nominal": 1.6, "calibrated": 0.46, "augmented": 0.1}


def fit(theta: dict[str, float], left: float = 1.0) -> Fit:
    return Fit(theta, 1000.0 * left, 1000, np.zeros((1000, 0)), np.ones(1000))


def failed(*checks: Check) -> set[str]:
    return {check.id for check in checks if not check.ok}


def travelled(way: float, seconds: float = 8.0) -> Record:
    t = np.linspace(0, seconds, 400)
    x = 0.5 * way * (1 - np.cos(2 * np.pi * t / seconds))
    return Record("r", "pull", {"t_s": t, "position_m": x, "force_N": np.zeros_like(t)})


def said(effect: type[Effect] | None = None, **changed: object) -> tuple[str, set[str]]:
    names = [effect.id] if effect else []
    theta = FOUND if effect else THETA
    given = {"spread": Theta.of({**TOLD, **AMPLITUDE}) if effect else TOLD, "held_out": HELD, "findings": (), **changed}
    found = Search(fit(theta), fit(theta), effects=names)
    checks = checks_of_model(KIND, found, given["spread"], given["held_out"], given["findings"])  # type: ignore[arg-type]
    return verdict_of(names, checks), failed(*checks)


NULL = Left(1.0, 0.01, 1.1, 1.0)


@pytest.mark.parametrize(
    ("left", "wrong"),
    [
        (Left(1.4, 0.09, 1.7, 1.55), set()),
        (Left(1.7, 0.01, 1.1, 1.0), {"residual_size"}),
        (Left(1.0, 0.2, 1.1, 1.0), {"whiteness"}),
        (Left(1.0, 0.01, 1.8, 1.0), {"validation"}),
        (Left(1.0, 0.01, 1.1, 1.7), {"held_out"}),
        (Left(1.0, 0.01, 1.1, np.nan), set()),
        (Left(0.01, 0.9, 1.1, 0.01), set()),  # what is left far below the noise has no structure that counts
    ],
)
def test_a_model_may_leave_little_more_than_fits_to_its_own_records(left: Left, wrong: set[str]) -> None:
    assert failed(*within(left, NULL)) == wrong


def test_motion_that_no_fit_follows_excuses_what_is_left() -> None:
    assert failed(*within(Left(1.0, 0.01, 12.2, 9.0), Left(1.0, 0.01, 8.5, 6.0))) == set()


def test_an_effect_whose_size_is_not_told_or_that_helps_no_held_out_record_is_not_named() -> None:
    vague = Theta.of({**TOLD, ("stribeck", "excess"): Fitted(0.5, (0.0, 3.0), identifiable=False)})
    assert said(Stribeck, spread=vague) == ("unknown", {"effects_told"})
    worse = {"nominal": 1.6, "calibrated": 0.46, "augmented": 0.67}
    assert said(Stribeck, held_out=worse) == ("unknown", {"held_out_gain"})
    assert said(Stribeck, held_out={})[0] == "named"


def test_the_size_of_an_effect_about_an_axis_must_be_told_too() -> None:
    """There it has another name than along a line."""
    t = np.arange(0, 4, 2e-3)
    turning = Record("r", "axis", {"t_s": t, "angle_rad": np.sin(t), "torque_N_m": np.cos(t)})
    kind = AxisKind.from_rig(Rig("axis"), [turning])
    size = ("viscous_drag", "coefficient_N_m")
    theta = Theta.of({**kind.nominal(), size: 0.3, ("viscous_drag", "exponent"): 0.5})
    whole = fit(theta)
    for told in (True, False):
        spread = {name: Fitted(value, (0.0, 1.0)) for name, value in theta.items()} | {
            size: Fitted(0.3, (-3.0, 3.0), identifiable=told)
        }
        found = Search(whole, whole, effects=["viscous_drag"])
        assert failed(*checks_of_model(kind, found, spread, {}, ())) == (set() if told else {"effects_told"})


def test_records_that_weaken_a_verdict_or_tell_no_parameter_never_end_in_none() -> None:
    finding = RecordFinding("clipping", "weakens", "a.csv", "force_N", "clips", "equal values", "a smaller gain")
    assert said(findings=(finding,)) == ("unknown", {"records"})
    vague = {name: Fitted(value, (0.0, 1e3), identifiable=False) for name, value in THETA.items()}
    assert said(spread=vague) == ("unknown", {"information"})


@pytest.mark.parametrize(("gain", "expected"), [(-0.2, set()), (0.1, set()), (0.27, {"candidate"})])
def test_nothing_is_none_while_a_candidate_gains_beyond_chance(gain: float, expected: set[str]) -> None:
    trial: Any = SimpleNamespace(gain=gain)
    found = Search(fit(THETA), fit(THETA), rounds=[(1, [], [trial])], threshold=0.4)
    assert failed(*checks_of_model(KIND, found, TOLD, {}, ())) == expected


def test_a_parameter_at_its_bound_is_told_but_the_zero_of_a_law_is_none() -> None:
    assert at_bounds(KIND, fit(THETA), []) == []
    assert at_bounds(KIND, fit(Theta.of({**THETA, "viscous_friction_N_s_per_m": 0.0})), []) == []
    assert at_bounds(KIND, fit(Theta.of({**THETA, "mass_kg": 1e3})), []) == ["mass_kg"]
    pull = SeriesKind.from_rig(Rig("pull", noise=Noise(force_std_N=1e-3)), [])
    relaxing = pull.nominal().with_(StressRelaxation.id, StressRelaxation.start()) | {
        ("stress_relaxation", "thinning_s_per_m"): 5e-6
    }
    assert at_bounds(pull, fit(relaxing), ["stress_relaxation"]) == []
    lagging = pull.nominal() | {("sensor_lowpass", "time_s"): 0.0}
    assert at_bounds(pull, fit(lagging), ["sensor_lowpass"]) == ["sensor_lowpass.time_s"]


def test_a_form_that_ends_as_it_is_declared_is_at_no_bound() -> None:
    """Play with an order of 1, the least, is play as it is declared; at the other end it would have gone further."""
    pull = SeriesKind.from_rig(Rig("pull", noise=Noise(force_std_N=1e-3)), [])
    theta = pull.nominal().with_(CarriageBacklash.id, CarriageBacklash.start()) | {
        ("carriage_backlash", "play_m"): 1e-3
    }
    assert at_bounds(pull, fit(Theta.of({**theta, ("carriage_backlash", "order"): 1.0})), ["carriage_backlash"]) == []
    stiff = at_bounds(pull, fit(Theta.of({**theta, ("carriage_backlash", "order"): 4.0})), ["carriage_backlash"])
    assert stiff == ["carriage_backlash.order"]


def test_a_curve_that_mends_a_shape_counts_at_a_bound_beyond_which_it_would_gain() -> None:
    """A bound of zero and one at which the fit has come to rest do not; 1 % and 20 % of the cost lie beyond others."""
    pull = SeriesKind.from_rig(Rig("pull", noise=Noise(force_std_N=1e-3)), [])
    curve = Theta.of({("level_at_onset", "kept"): 1.5, ("level_at_onset", "spared"): 0.0})
    theta = pull.nominal().with_(FoldPeriodic.id, FoldPeriodic.start()) | {("fold_periodic", "depth"): 0.3, **curve}
    names = [axis.name for axis in axes(pull, ["fold_periodic", "level_at_onset"])]
    rows = np.random.default_rng(0).normal(size=(1000, len(names)))
    rest = np.linalg.qr(np.column_stack([rows, np.ones(1000)]))[0]
    away = rest[:, :-1] @ np.linalg.inv(rest[:, :-1].T @ rows).T  # away[:, k] moves with the k-th column alone
    kept = away[:, names.index(("level_at_onset", "kept"))]
    for share in (0.0, 0.01, 0.2):
        residual = np.sqrt(share) * kept / np.linalg.norm(kept) + np.sqrt(1 - share) * rest[:, -1]
        last = Fit(theta, 1000.0, 1000, rows, np.sqrt(1000.0) * residual)
        found = Search(fit(theta), last, effects=["fold_periodic"], refinements=["level_at_onset"], after=1.0)
        depth = Theta.of({("fold_periodic", "depth"): Fitted(0.3, (0.2, 0.4))})
        checks = checks_of_model(pull, found, depth, HELD, ())
        counted = ["level_at_onset.kept"] if share > 0.1 else []
        assert at_bounds(pull, last, found.effects, found.refinements) == counted
        assert next(check.value for check in checks if check.id == "bounds") == len(counted)


def test_a_stage_that_errs_more_on_held_out_records_than_one_before_it_is_told() -> None:
    assert list(setbacks({"nominal": 1.6, "calibrated": 0.46, "augmented": 0.67}, 0.1)) == ["augmented"]
    assert list(setbacks({"nominal": 1.0, "calibrated": 1.3, "augmented": 0.2}, 0.1)) == ["calibrated"]
    assert not setbacks({"nominal": 1.6, "calibrated": 0.46, "augmented": 0.1}, 0.1)
    assert not setbacks({}, 0.1)
    assert not setbacks({"nominal": 0.10, "calibrated": 0.12, "augmented": 0.12}, 0.1)  # both leave the noise
    assert list(setbacks({"nominal": 0.10, "calibrated": 0.12, "augmented": 0.12}, float("nan"))) == [
        "calibrated",
        "augmented",
    ]
    said_worse = {"calibrated": "the calibrated model predicts worse"}
    bounds = {"calibrated": ["mass_kg"], "augmented": ["mass_kg", "stenosis.tail"]}
    told = setback_findings(said_worse, [], bounds, "calibrated")
    assert told[0].severity == "weakens"
    assert "mass_kg" in told[0].sentence
    assert setback_findings(said_worse, [], {}, None)[0].severity == "note"
    assert setback_findings(said_worse, [], {}, "augmented")[0].severity == "note"  # the effects are missing in it
    worse = {"nominal": 0.3, "calibrated": 0.46, "augmented": 0.4}
    assert said(Stribeck, held_out=worse) == ("unknown", {"held_out_gain"})


def test_a_period_that_no_record_shows_twice_is_not_named() -> None:
    pull = SeriesKind.from_rig(Rig("pull", noise=Noise(force_std_N=1e-3)), [])
    theta = pull.nominal().with_(Respiration.id, Respiration.start()) | {
        ("respiration", "force_N"): 0.01,
        ("respiration", "frequency_Hz"): 0.1,
    }
    found = Search(fit(theta), fit(theta), effects=["respiration"], after=1.0)
    size = Theta.of({("respiration", "force_N"): Fitted(0.01, (0.009, 0.011))})
    for seconds, wrong in ((12.0, {"periods"}), (25.0, set())):
        periods = periods_of(pull, found.effects, theta, [travelled(6e-3, seconds)])
        assert failed(*checks_of_model(pull, found, size, HELD, (), periods)) == wrong


@pytest.mark.parametrize("records", [1, 48])
def test_a_wavelength_that_the_covered_way_does_not_repeat_is_not_named(records: int) -> None:
    """However many records cover the same little way."""
    pull = SeriesKind.from_rig(Rig("pull", noise=Noise(force_std_N=1e-3)), [])
    theta = pull.nominal().with_(FoldPeriodic.id, FoldPeriodic.start()) | {
        ("fold_periodic", "depth"): 0.3,
        ("fold_periodic", "wavelength_m"): 7.3e-3,
    }
    found = Search(fit(theta), fit(theta), effects=["fold_periodic"], after=1.0)
    size = Theta.of({("fold_periodic", "depth"): Fitted(0.3, (0.2, 0.4))})
    for way, wrong in ((6e-3, {"periods"}), (15e-3, set())):
        some = [travelled(way)] * records
        periods = periods_of(pull, found.effects, theta, some)
        assert failed(*checks_of_model(pull, found, size, HELD, (), periods)) == wrong
        open_ = unshown(pull, found.effects, theta, some)
        assert open_ == (
            {("fold_periodic", "wavelength_m"): (pytest.approx(way / 2, rel=1e-3), 0.016)} if wrong else {}
        )
    apart = [travelled(6e-3), travelled(6e-3).with_column("position_m", travelled(6e-3)["position_m"] + 0.1)]
    assert periods_of(pull, found.effects, theta, apart)[("fold_periodic", "wavelength_m")] == pytest.approx(
        7.3 / 6, rel=1e-3
    )


@pytest.mark.parametrize(
    ("effect", "name", "value", "covered"),
    [
        (TissueDrying, "settling_s", 30.0, 12.0),
        (Preconditioning, "length_m", 0.05, 12e-3),
        (Stenosis, "centre_m", 0.02, 6e-3),
        (StressRelaxation, "time_s", 15.0, 12.0),
    ],
)
@pytest.mark.parametrize("records", [1, 48])
def test_a_range_that_the_records_do_not_cover_is_left_open(
    effect: type[Effect], name: str, value: float, covered: float, records: int
) -> None:
    pull, some = SeriesKind.from_rig(Rig("pull"), []), [travelled(6e-3, 12.0)] * records
    theta = pull.nominal().with_(effect.id, effect.start())
    low, high = unshown(pull, [effect.id], theta | {(effect.id, name): value}, some)[(effect.id, name)]
    assert low == pytest.approx(covered, rel=0.1)
    assert high == next(p.upper for p in effect.parameters() if p.name == name)
    assert (effect.id, name) not in unshown(pull, [effect.id], theta | {(effect.id, name): 0.4 * covered}, some)
