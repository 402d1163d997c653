"""What a model file carries for the choice of what leads, and what must not lead."""

import tomllib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from models.identification import Model
from models.identification.finding import STAGES, Check
from models.identification.fitting.fit import judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.identification.possible import absorbs, barred, held, left_by, mean_of, refuted
from models.identification.steps import Judged
from models.records.record import Record, record_of
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta
from tests.rig_texts import GUT

LAG = {"time_s": 0.1}
MAGNETIC = {"kind": "magnetic", "magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02}


@pytest.fixture(scope="module")
def rig() -> Rig:
    return parse_rig({**tomllib.loads(GUT), "rig": MAGNETIC}, "rig file")


@pytest.fixture(scope="module")
def record(rig: Rig) -> Record:
    t = 0.01 * np.arange(300.0)
    return record_of("led", {"t_s": t, "carriage_position_m": 1e-3 * t, "position_m": 1e-3 * t}, rig)


@pytest.fixture(scope="module")
def model(rig: Rig, record: Record) -> Model:
    base = kind_for(rig, [record]).nominal()
    delayed = base.with_("sensor_delay", {"delay_s": 0.1})
    possible = {"actuator_lag": base.with_("actuator_lag", LAG), "draw_1": delayed}
    stages = {"nominal": base, "calibrated": base, "augmented": delayed}
    told = {"calibrated": "friction_coefficient is at its bound."}
    lacks = {"calibrated": {"force_N": 3e-3, "time_s": 0.4}}
    known = {"held_out": dict.fromkeys(STAGES, 1e-4), "barred": told, "possible": possible, "unexplained": lacks}
    return Model("magnetic", stages, "named", **known)


def test_a_choice_is_read_back_as_it_was_written(model: Model) -> None:
    again = Model.from_toml(model.to_toml())
    assert again == model
    assert again.members == ("actuator_lag",)
    assert again.believed("actuator_lag")["actuator_lag", "time_s"] == 0.1


def test_the_mean_of_a_class_has_a_part_of_each_effect(model: Model, rig: Rig, record: Record) -> None:
    """Sizes are shared among the members, numbers of a shape are not: a narrow place stays where it is."""
    kind = kind_for(rig, [record])
    narrow = {"excess": 0.8, "centre_m": 6e-3, "width_m": 3e-3, "tail": 0.1, "skew": 0.2}
    lagging = model.possible["actuator_lag"] | Theta(effects={"stenosis": narrow}) | {"friction_coefficient": 0.09}
    mean = mean_of(kind, [model.stages["augmented"], lagging])
    assert mean["friction_coefficient"] == pytest.approx(0.5 * (0.09 + kind.nominal()["friction_coefficient"]))
    assert mean["sensor_delay", "delay_s"] == pytest.approx(0.05)
    assert mean["actuator_lag", "time_s"] == pytest.approx(0.05)
    assert mean.effects["stenosis"] == pytest.approx(narrow | {"excess": 0.4})
    replace(model, possible=dict(model.possible) | {"class": mean}).check(rig, record)


def test_a_file_without_a_choice_carries_none(model: Model) -> None:
    text = replace(model, possible={}, barred={}, unexplained={}).to_toml()
    assert not any(word in text for word in ("possible", "barred", "refuted", "unexplained"))
    assert not Model.from_toml(text).possible


@pytest.mark.parametrize(
    ("possible", "words"),
    [
        ({"other": Theta.read({"friction_coefficient": 0.08})}, r"possible\.other"),
        ({"other": Theta(effects={"unheard_of": {"a": 1.0}})}, "unheard_of"),
    ],
)
def test_values_of_a_possible_model_are_checked(
    possible: dict[str, Theta], words: str, model: Model, rig: Rig, record: Record
) -> None:
    with pytest.raises(ValueError, match=words):
        Model.from_toml(replace(model, possible=possible).to_toml()).check(rig, record)


def test_a_changed_possible_value_is_damage(model: Model) -> None:
    text = model.to_toml().replace('"actuator_lag.time_s" = 0.1', '"actuator_lag.time_s" = 0.2')
    with pytest.raises(ValueError, match="must be whole"):
        Model.from_toml(text).check_whole()


def test_records_refute_a_stage_that_errs_far_more_than_the_best() -> None:
    errors = {"nominal": 1.2e-3, "calibrated": 0.6e-3, "augmented": 0.5e-3}
    assert set(refuted("none", errors, (), "m")) == {"nominal"}
    assert set(refuted("named", errors, (), "m")) == {"nominal", "calibrated"}
    assert set(refuted("unknown", errors, (), "m")) == set()
    assert "1.2 mm" in refuted("named", errors, (), "m")["nominal"]
    assert refuted("none", {}, (), "m") == {}


def test_what_must_not_lead_refutes_no_other() -> None:
    """Parts at their bounds follow the records as nothing else does; the worlds without them are left all the same."""
    errors = {"nominal": 0.96e-3, "calibrated": 1.08e-3, "augmented": 0.13e-3}
    assert set(refuted("unknown", errors, (), "m")) == {"nominal", "calibrated"}
    assert refuted("unknown", errors, ("augmented",), "m") == {}


def test_a_held_base_stays_near_the_rig_file_where_the_records_allow(rig: Rig) -> None:
    """One slow way shows hoop stress times friction alone: held, neither is at its bound, and the fit is as good."""
    t = np.arange(0.0, 12.0, 0.01)
    blank = record_of("way", {"t_s": t, "carriage_position_m": 1e-3 * t, "position_m": 1e-3 * t}, rig)
    kind = kind_for(rig, [blank])
    assert isinstance(kind, SeriesKind)
    truth = kind.nominal() | {"hoop_stress_factor": 1.1, "friction_coefficient": 0.09}
    made = [kind.imitate(blank, truth, np.random.default_rng(2))]
    free = Fitter.of(kind, made, [], kind.final).near(kind.nominal() | {"hoop_stress_factor": 1.449})
    theta = held(kind, made, [], free.theta)
    assert abs(theta["hoop_stress_factor"] - 1) < 0.2
    assert judged_cost(kind, made, theta) < 1.02 * judged_cost(kind, made, free.theta)


@pytest.mark.parametrize(("kind", "command"), [("magnetic", "carriage_position_m"), ("coil", "coil_current_A")])
def test_the_force_that_a_model_lacks(kind: str, command: str) -> None:
    """Records of a rig with a drag of 15 mN at 1 mm/s: the model without it lacks about that, the right one nothing."""
    own = MAGNETIC if kind == "magnetic" else {"kind": "coil", "force_constant_N_per_A": 0.5}
    rig = parse_rig({**tomllib.loads(GUT), "rig": own}, "rig file")
    t = 0.01 * np.arange(2000.0)
    driven = 8e-3 * np.sin(0.7 * t) if kind == "magnetic" else 0.35 * np.sin(2.0 * t)
    blank = record_of("led", {"t_s": t, command: driven, "position_m": 1e-6 * np.sin(9 * t)}, rig)
    series = replace(kind_for(rig, [blank]), noise_std=0.05e-3)
    assert isinstance(series, SeriesKind)
    base = series.nominal()
    true = base.with_("viscous_drag", {"coefficient_N": 15e-3, "exponent": 1.0})
    record = series.imitate(blank, true, np.random.default_rng(0))
    assert left_by(series, [record], true) == {}
    lacks = left_by(series, [record], base)
    assert 3e-3 < lacks["force_N"] < 60e-3
    assert 0.1 < lacks["time_s"] < 5.0


def test_where_no_friction_moves_a_run_no_force_is_lacking() -> None:
    rig = parse_rig({**tomllib.loads(GUT), "rig": {"kind": "coil", "force_constant_N_per_A": 0.5}}, "rig file")
    t = 0.01 * np.arange(2000.0)
    still = {"t_s": t, "coil_current_A": 1e-3 * np.sin(t), "position_m": 1e-3 * np.sin(t)}
    record = record_of("still", still, rig)
    kind = kind_for(rig, [record])
    assert isinstance(kind, SeriesKind)
    assert left_by(replace(kind, noise_std=1e-6), [record], kind.nominal()) == {}


def judged(verdict: str, worse: dict[str, str], failing: str = "") -> Judged:
    checks = (Check(failing, "", 2.0, 1.0, False, ""),) if failing else ()
    return Judged(verdict, checks, (), {}, 0.0, worse)


@pytest.mark.parametrize(
    ("verdict", "bound", "worse", "stages"),
    [
        ("named", "calibrated", {}, {"calibrated"}),
        ("unknown", "augmented", {}, {"augmented"}),
        ("unknown", "", {}, set()),
        ("none", "", {"augmented": "it errs more"}, {"augmented"}),
    ],
)
def test_what_must_not_lead(
    verdict: str, bound: str, worse: dict[str, str], stages: set[str], model: Model, rig: Rig, record: Record
) -> None:
    """A base or a part of `unknown` at its bound, and a stage that errs more than an earlier one."""
    kind = kind_for(rig, [record])
    friction = next(p for p in kind.base if p.name == "friction_coefficient")
    at_end = {friction.name: friction.upper}
    ends = {stage: values | (at_end if stage == bound else {}) for stage, values in model.stages.items()}
    fits: dict[str, Any] = {stage: SimpleNamespace(theta=values) for stage, values in ends.items()}
    found: Any = SimpleNamespace(
        calibrated=fits["calibrated"], augmented=fits["augmented"], effects=["sensor_delay"], refinements=[]
    )
    prepared: Any = SimpleNamespace(kind=kind)
    assert set(barred(prepared, found, judged(verdict, worse))) == stages


@pytest.mark.parametrize(
    ("verdict", "effects", "failing", "nominal_m", "expected"),
    [
        ("unknown", [], "residual_size", 2.5e-3, True),
        ("unknown", [], "held_out", 2.5e-3, True),
        ("unknown", [], "held_out", 5e-3, False),
        ("unknown", [], "validation", 2.5e-3, False),
        ("unknown", ["sensor_delay"], "residual_size", 2.5e-3, False),
        ("none", [], "", 2.5e-3, False),
    ],
)
def test_a_fit_that_makes_up_for_what_was_not_found(
    verdict: str, effects: list[str], failing: str, nominal_m: float, expected: bool
) -> None:
    """Unless it errs so much less than the rig file's numbers that the records exclude these."""
    found: Any = SimpleNamespace(effects=effects)
    errors = {"nominal": nominal_m, "calibrated": 1e-3, "augmented": 1e-3}
    assert absorbs(judged(verdict, {}, failing), found, errors) is expected
