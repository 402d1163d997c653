"""What leads: the least worst error over the possible models, ties to the simpler, no worse than nominal or PID."""

import math
from collections.abc import Mapping
from types import MappingProxyType

import pytest

import controller.choice.choose as choose_module
from controller.choice.choose import Candidate, Chosen, Comparison, choose
from controller.choice.trial import Mission, Outcome
from controller.choice.world import Push
from controller.limits import Limits
from controller.model.control_model import ControlModel
from controller.reference import through
from tests.controller.loops import model_of

Errors = Mapping[tuple[str, str], tuple[float, ...]]
"""The rms errors in mm of a stage under a controller, one a world; inf: a limit is broken."""
MISSION = Mission(through([2e-3], 1e-3, 0.5, 0.5), 3.0, Limits())
RANKS = {"nominal": 0, "calibrated": 1}


def compared(errors: Errors, monkeypatch: pytest.MonkeyPatch, refuted: str = "") -> tuple[Comparison, list[Candidate]]:
    """A comparison whose trials give `errors`."""
    model, worlds = model_of(), [f"world {k}" for k in range(len(next(iter(errors.values()))))]
    names = list(dict.fromkeys(controller for _, controller in errors))
    candidates = [Candidate(s, c, model, (RANKS.get(s, 2), names.index(c)), s == refuted) for s, c in errors]
    tried = iter(range(1000))

    def outcome(comparison: Comparison, pairs: list[tuple[choose_module.Row, str]], most_m: float = math.inf) -> None:
        for row, name in pairs:
            error = 1e-3 * errors[row.candidate.stage, row.candidate.controller][worlds.index(name)]
            broken, whole = math.isinf(error), math.isinf(error) or error <= most_m
            row.outcomes[name] = Outcome(error if whole else most_m, broken, whole)
            comparison.runs = next(tried) + 1

    monkeypatch.setattr(Comparison, "_try", outcome)
    pushes = dict.fromkeys(worlds, Push())
    return Comparison(MISSION, candidates, pushes, lambda name, before: model, lambda words, share: None), candidates


def chosen(
    errors: Errors, monkeypatch: pytest.MonkeyPatch, pushes: Mapping[str, float] = MappingProxyType({})
) -> Chosen:
    """What leads by these errors, in worlds with `pushes` in N."""
    comparison, candidates = compared(errors, monkeypatch)
    count = len(next(iter(errors.values())))
    worlds = {name: Push(pushes.get(name, 0.0)) for name in (f"world {k}" for k in range(count))}
    found = choose(MISSION, candidates, worlds, lambda name, before: candidates[0].model, lambda words, share: None)
    if not pushes:
        leading = comparison.best().candidate
        assert (found.stage, found.controller) == (leading.stage, leading.controller)
    return found


def test_the_least_worst_error_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    found = chosen(
        {
            ("nominal", "feedforward"): (0.18, 0.18, 0.18),
            ("nominal", "pid"): (0.3, 0.3, 0.3),
            ("augmented", "feedforward"): (0.03, 0.05, 0.07),
            ("augmented", "mpc"): (0.02, 0.03, 0.5),
        },
        monkeypatch,
    )
    assert (found.stage, found.controller) == ("augmented", "feedforward")
    assert found.expected["augmented"] == pytest.approx(0.05e-3)
    assert found.expected["nominal"] == pytest.approx(0.18e-3)
    assert "augmented with feedforward 50 µm (30 µm to 70 µm), nominal 180 µm" in found.why


def test_a_member_of_the_class_leads_where_it_is_least_bad_over_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """`sensor_delay` was named though the drive lags: the other member is the better one in both worlds together."""
    found = chosen(
        {
            ("nominal", "feedforward"): (0.15, 0.2),
            ("augmented", "feedforward"): (0.03, 0.19),
            ("actuator_lag", "feedforward"): (0.06, 0.04),
        },
        monkeypatch,
    )
    assert found.stage == "actuator_lag"


@pytest.mark.parametrize(
    ("better", "stage"), [(0.97, "nominal"), (0.9, "calibrated")], ids=["a tie goes to the simpler", "no tie"]
)
def test_ties(better: float, stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {("nominal", "feedforward"): (0.2, 0.2), ("calibrated", "feedforward"): (0.2 * better, 0.2 * better)}
    assert chosen(errors, monkeypatch).stage == stage


def test_a_broken_limit_never_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {("nominal", "feedforward"): (0.9, 0.9), ("augmented", "mpc"): (0.01, math.inf)}
    assert chosen(errors, monkeypatch).stage == "nominal"


INF = math.inf
EACH_BREAKS = {
    "all in all worlds, so the simplest": (
        {("augmented", "mpc"): (INF, INF), ("nominal", "mpc"): (INF, INF)}, "nominal",
    ),
    "fewer worlds": (
        {("nominal", "mpc"): (INF, INF, 0.1), ("augmented", "mpc"): (INF, 0.8, 0.9)}, "augmented",
    ),
    "another as few, and errs less in the others": (
        {("nominal", "mpc"): (INF, 0.3, 0.4), ("augmented", "mpc"): (0.1, 0.2, INF)}, "augmented",
    ),
    "equal, so the simpler": (
        {("nominal", "mpc"): (INF, 0.3, 0.4), ("augmented", "mpc"): (INF, 0.3, 0.39)}, "nominal",
    ),
    "it gains in one world and loses in another": (
        {("nominal", "mpc"): (INF, 0.33, 0.2), ("augmented", "mpc"): (INF, 0.02, 0.25)}, "nominal",
    ),
    "fewest is the nominal one, which errs more": (
        {("nominal", "mpc"): (INF, 0.9, 0.9), ("augmented", "mpc"): (INF, 0.1, INF)}, "nominal",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", EACH_BREAKS)
def test_where_each_breaks_a_limit_the_one_with_fewest_such_worlds_leads(
    case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of equally many the least worst in its other worlds, by the same rule."""
    errors, stage = EACH_BREAKS[case]
    found = chosen(errors, monkeypatch)
    assert found.stage == stage
    fewest, count = (2, 2) if case.startswith("all") else (1, 3)
    kept = [1e-3 * error for error in next(e for (s, _), e in errors.items() if s == stage) if error < INF]
    expected = pytest.approx(sum(kept) / len(kept)) if kept else None
    assert found.fails
    assert found.document()["expected_rmse_m"][stage] == expected
    assert f"Each breaks a limit in {fewest} or more of {count} possible worlds" in found.why


def test_a_world_that_drive_and_limits_could_not_have_produced_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    """In it every candidate breaks a limit; without it the one that the other worlds prefer leads."""
    errors = {
        ("nominal", "mpc"): (0.4, INF, 0.2),
        ("nominal", "pid"): (0.3, INF, 0.1),
        ("augmented", "mpc"): (0.1, INF, 0.1),
    }
    found = chosen(errors, monkeypatch, {"world 1": 7.6, "world 2": 0.4})
    assert found.stage == "augmented"
    assert (
        "world 1 is no possible world: it lacks 7.6 N rms on the records, and drive and limits allow 500 mN."
        in found.why
    )
    assert "world 2 is no" not in found.why


def test_where_every_world_lacks_more_than_can_be_they_count_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {("nominal", "mpc"): (0.4, 0.2), ("augmented", "mpc"): (0.1, 0.1)}
    found = chosen(errors, monkeypatch, {"world 0": 7.6, "world 1": 2.0})
    assert found.stage == "augmented"
    assert found.why.count("is no possible world") == 2


@pytest.mark.parametrize(("other", "stage"), [(0.25, "nominal"), (0.18, "augmented")])
def test_nothing_leads_that_loses_against_the_nominal_model_in_a_possible_world(
    other: float, stage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its worst error is the least, but it gains in one world what it loses in another."""
    errors = {("nominal", "feedforward"): (0.33, 0.2), ("augmented", "feedforward"): (0.02, other)}
    assert chosen(errors, monkeypatch).stage == stage


def test_a_small_loss_beside_what_the_nominal_model_risks_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {("nominal", "feedforward"): (2.3, 0.65), ("augmented", "feedforward"): (0.06, 0.7)}
    assert chosen(errors, monkeypatch).stage == "augmented"


def test_a_plain_choice_that_breaks_a_limit_somewhere_is_no_better_one(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {("nominal", "feedforward"): (0.5, 0.1, math.inf), ("augmented", "feedforward"): (0.3, 0.3, 0.3)}
    assert chosen(errors, monkeypatch).stage == "augmented"


def test_a_plain_choice_counts_with_all_that_it_risks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a trial of it was given up at first, its error is far above what was seen of it then."""
    errors = {("nominal", "feedforward"): (0.5, 9.0, 0.25), ("augmented", "feedforward"): (0.3, 0.3, 0.3)}
    assert chosen(errors, monkeypatch).stage == "augmented"


def test_a_model_that_the_records_refute_bars_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """It leads only where its own worst error is the least."""
    errors = {("nominal", "mpc"): (1.1, 0.25), ("augmented", "mpc"): (0.03, 0.38)}
    assert compared(errors, monkeypatch)[0].best().candidate.stage == "nominal"
    assert compared(errors, monkeypatch, "nominal")[0].best().candidate.stage == "augmented"


def test_nothing_leads_that_loses_against_the_pid(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {
        ("nominal", "feedforward"): (0.3, 0.3),
        ("nominal", "pid"): (0.1, 0.32),
        ("augmented", "feedforward"): (0.2, 0.1),
    }
    assert chosen(errors, monkeypatch).stage == "nominal"


def test_trials_that_cannot_change_the_answer_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {("augmented", "feedforward"): (0.03,) * 6} | {
        (stage, controller): (0.3,) * 6
        for stage in ("nominal", "calibrated", "member")
        for controller in ("feedforward", "mpc")
    }
    comparison, _ = compared(errors, monkeypatch)
    assert comparison.best().candidate.stage == "augmented"
    whole = sum(outcome.whole for row in comparison.rows for outcome in row.outcomes.values())
    assert whole < len(errors) * 6 / 3


def test_worlds_are_made_for_the_rig_of_the_leading_model() -> None:
    """Two real trials of 1 s: the world is asked for by name, with the leading model."""
    asked: list[tuple[str, ControlModel]] = []
    model = model_of()

    def world(name: str, before: ControlModel) -> ControlModel:
        asked.append((name, before))
        return model

    short = Mission(through([0.5e-3], 1e-3, 0.0, 0.1), 1.0, Limits())
    found = choose(
        short,
        [Candidate("nominal", "pid", model, (0, 0))],
        {"one": Push(), "other": Push()},
        world,
        lambda words, share: None,
    )
    assert {name for name, _ in asked} == {"one", "other"}
    assert 0 < found.expected["nominal"] < 0.5e-3
