"""The gate: only a model that is better on held-out records and within its bounds passes."""

import math
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import pytest

from controller.supervision.acceptance import judge
from models.identification.model import Model
from models.parameter import Name
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta, spelled

BASE = Theta({"hoop_stress_factor": 1.1, "friction_coefficient": 0.09, "magnet_stiffness_N_per_m": 26.0})
FOLDS = Theta.of({("fold_periodic", "depth"): 0.2, ("fold_periodic", "wavelength_m"): 0.0073})


def model(changes: Mapping[Name, float] = MappingProxyType({})) -> Model:
    return Model("magnetic", {"nominal": BASE, "calibrated": BASE, "augmented": BASE | changes})


def report(
    nominal: float | None = 3.0, calibrated: float | None = 2.0, augmented: float | None = 1.0
) -> dict[str, Any]:
    return {
        "kind": "magnetic",
        "error": {"holdout": {"nominal": nominal, "calibrated": calibrated, "augmented": augmented}},
    }


@pytest.fixture
def rig(rig_text: str) -> Rig:
    return parse_rig(tomllib.loads(rig_text))


def test_a_better_model_within_bounds_passes(rig: Rig) -> None:
    verdict = judge(report(), model(FOLDS), rig)
    assert verdict.passed, verdict.sentence


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        (report(augmented=2.0), "at most 0.99"),
        (report(augmented=None), "must be in the report"),
        (report(augmented=math.nan), "must be in the report"),
        (report(augmented=-1.0), "must be in the report"),
        (report(calibrated=None), "current model must be known"),
        ({}, "must be in the report"),
        ({"error": {"holdout": "none"}}, "must be in the report"),
        (report() | {"kind": "pull"}, "magnetic rig; got one of a pull rig"),
    ],
)
def test_a_model_that_did_not_show_it_does_not_pass(rig: Rig, numbers: dict[str, Any], words: str) -> None:
    verdict = judge(numbers, model(), rig)
    assert not verdict.passed
    assert words in verdict.sentence


@pytest.mark.parametrize(
    "changes",
    [
        {"hoop_stress_factor": 9.0},
        {"friction_coefficient": math.nan},
        Theta.of({("fold_periodic", "wavelength_m"): -1.0}),
        {"no_such": 1.0},
    ],
)
def test_parameters_out_of_bounds_do_not_pass(rig: Rig, changes: Mapping[Name, float]) -> None:
    verdict = judge(report(), model(changes), rig)
    assert not verdict.passed
    assert spelled(next(iter(changes))) in verdict.sentence


def test_the_current_model_may_be_given_by_its_error_on_the_same_records(rig: Rig) -> None:
    assert judge(report(), model(), rig, current=1.2).passed
    assert not judge(report(), model(), rig, current=0.9).passed


def test_unknown_stages_are_refused(rig: Rig) -> None:
    with pytest.raises(ValueError, match="did you mean 'augmented'"):
        judge(report(), model(), rig, stage="augmentd")
