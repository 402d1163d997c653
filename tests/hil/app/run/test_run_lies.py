"""Localisers and drives that lie by valid frames, led by the loop of `capsule run`: they stop the run, or do no harm
and are told.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller.drives import envelope_of
from controller.limits import Limits
from controller.signals import Measurement
from controller.supervision.breakaway import Resistance
from hil.nodes.plausibility import Onlooker
from plant import layout as at
from tests.hil.app.docs.ends import RUN_ENDS
from tests.hil.app.run.test_run_ends import Rig, led
from tests.hil.app.sil.sil_runs import model_of

GAP_M = 0.02 / np.sqrt(3)
HOLD = {"kind": "hold"}
PROBED = {"judged_from_s": 0.1, "probe": True}
STATUS = {name: end.status for name, end in RUN_ENDS.items()}


def farthest_m(node: Rig) -> float:
    """The largest distance of the true capsule from where it was, in m."""
    rows = np.concatenate(node.bench.plant.session.rows)
    return float(np.max(np.abs(rows[:, at.O_X] - rows[0, at.O_X])))


def told(kind: str, **more: Any) -> Mapping[str, Any]:
    """A lie of the localisation from the start on."""
    return {"kind": kind, "at_s": 0.0, "duration_s": 90.0, "target": "localisation", **more}


def done(kind: str, **more: Any) -> Mapping[str, Any]:
    """A lie of the drive."""
    return told(kind, **more) | {"target": "drive"}


@pytest.mark.parametrize("speed_m_s", [2e-3, 5e-3, 0.02])
def test_a_localisation_that_drifts_does_not_lead_the_capsule_away(tmp_path: Path, speed_m_s: float) -> None:
    lie = told("drift", value=speed_m_s) | {"at_s": 1.0}
    outcome, node = led(tmp_path, lie, seconds=15.0, reference=HOLD)
    assert (outcome.end, STATUS[outcome.end]) == ("sensor_or_drive", 1)
    assert outcome.ended.startswith("sensor or drive contradict each other: ")
    assert farthest_m(node) < GAP_M
    assert node.bench.plant.drive.safe


@pytest.mark.parametrize(
    "lie",
    [
        told("flipped"),
        told("held"),
        done("held"),
        done("turned"),
        done("scaled", value=2.0),
        done("scaled", value=0.5),
    ],
    ids=lambda lie: f"{lie['kind']} {lie['target']} {lie.get('value', '')}",
)
def test_the_probe_finds_a_sign_a_gain_and_an_answer_that_are_wrong(tmp_path: Path, lie: Mapping[str, Any]) -> None:
    outcome, node = led(tmp_path, lie, control=PROBED)
    assert (outcome.end, STATUS[outcome.end]) == ("sensor_or_drive", 1)
    assert outcome.ended.startswith("sensor or drive contradict each other: ")
    assert farthest_m(node) < GAP_M


def test_a_sound_rig_is_probed_and_then_led_for_the_whole_time(tmp_path: Path) -> None:
    outcome, node = led(tmp_path, control=PROBED, seconds=1.0)
    assert outcome.end == "done"
    assert node.answer.led.keys() == {"feedforward"}
    rows = np.concatenate(node.bench.plant.session.rows)
    assert np.ptp(rows[:, at.O_X]) == pytest.approx(0.01, abs=1.5e-3), "5 mm to and fro"


@pytest.mark.parametrize("age_s", [0.06, 0.12])
def test_a_localisation_that_says_how_late_it_is_is_led_by(tmp_path: Path, age_s: float) -> None:
    """`limits.age_s` is 0.15 s, for the estimator as for the guard."""
    outcome, node = led(tmp_path, told("late", value=age_s), seconds=3.0)
    assert outcome.end == "done"
    assert node.answer.led["feedforward"] > 0.99 * node.answer.led.total()


@pytest.mark.parametrize(("lie", "begins"), [(done("restless", value=0.02), ""), (done("restless", value=0.2), "done")])
def test_a_drive_must_rest_before_and_after(tmp_path: Path, lie: Mapping[str, Any], begins: str) -> None:
    late = dict(lie)
    if begins:
        late["at_s"] = 1.35
    outcome, _ = led(tmp_path, late)
    assert (outcome.end, STATUS[outcome.end]) == ("no_rest", 1)
    assert "the drive does not rest" in outcome.ended


def test_a_jump_is_doubted_then_followed_slowly_and_told(tmp_path: Path) -> None:
    lie = {"kind": "jumped", "at_s": 1.0, "duration_s": 90.0, "target": "localisation", "value": 0.004}
    outcome, node = led(tmp_path, lie, seconds=3.0, reference=HOLD)
    rows = np.concatenate(node.bench.plant.session.rows)
    speed = np.abs(np.diff(rows[:, at.O_DRIVE]) / np.diff(rows[:, at.O_T]))
    after = rows[1:, at.O_T] > 1.0
    assert node.answer.jumps == 1
    assert node.answer.jump_m == pytest.approx(0.004, abs=1.5e-3)
    soon = after & (rows[1:, at.O_T] < 1.1)
    assert np.max(np.convolve(speed[soon], np.full(50, 0.02), "same")) < 0.06, "250 mm/s before"
    assert np.max(np.convolve(speed[after], np.full(50, 0.02), "same")) < 0.2
    assert farthest_m(node) < 6e-3
    assert outcome.end in ("done", "not_led")


@pytest.mark.parametrize(("speed_m_s", "jump_m", "jumps"), [(0.1, 0.0, 0), (0.0, 3e-3, 1), (0.02, -3e-3, 1)])
def test_a_step_of_the_estimate_is_a_jump_where_the_readings_step(speed_m_s: float, jump_m: float, jumps: int) -> None:
    """Behind a drive that lags the estimate steps by 2 mm and more, while the capsule goes on steadily."""
    envelope = envelope_of(model_of("magnetic").drive, Limits())
    onlooker, rng = Onlooker(envelope, 3e-4, 2e-3, 2.5e-4, Resistance()), np.random.default_rng(1)
    for k in range(20):
        place_m = speed_m_s * 0.005 * k + (jump_m if k > 9 else 0.0)
        reading = Measurement("position_m", place_m + 2.5e-4 * rng.standard_normal(), 0.005 * k)
        onlooker.believe(0.005 * k, 3e-3 * (k > 11), int(k > 11), [reading])
    assert onlooker.cautious_s == pytest.approx(0.06)
    assert onlooker.jumps == jumps
    assert onlooker.jump_m == pytest.approx(jump_m, abs=5e-4)
    assert bool(onlooker.words) == bool(jumps)
