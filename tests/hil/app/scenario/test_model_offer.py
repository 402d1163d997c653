"""`[offer]`: a model that close-loop improved takes over while the controller leads, at a rest, past the gate, without
a jump.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from controller.estimator.base import Estimator
from controller.monitor import Monitor
from controller.supervision.acceptance import Acceptance
from controller.supervision.model_switch import ModelSwitch, Offer, Prepared
from hil.app.main import run
from hil.app.scenario.deployment import load_deployment
from hil.app.scenario.model_use import read_offer
from hil.app.scenario.scenario import TrackScenario, load_track_scenario
from hil.app.track.loop import LoopTrace, believed_model, run_loop
from models.identification import Model
from models.identification.kinds import kind_for
from models.theta import Theta
from plant import layout as at
from tests.hil.app.run.deployments import deployment, rig_file

FOLDS = Theta(
    effects={
        "fold_periodic": {
            "depth": 0.3,
            "wavelength_m": 0.0073,
            "phase_rad": 0.4,
            "second_sin": 0.24,
            "second_cos": 0.25,
        }
    }
)
STEPS = """
[scenario]
name = "steps over folds"
duration_s = {seconds}
seed = 1
[rig]
kind = "magnetic"
[effects.fold_periodic]
excess = 0.3
wavelength_m = 0.0073
phase_rad = 0.4
[reference]
kind = "steps"
positions_mm = [4.0, 12.0, 4.0, 12.0]
speed_mm_s = 4.0
dwell_s = 1.0
"""
OFFER = """
[offer]
file = "model.toml"
report = "report.json"
at_s = 1.5
"""


def offered(folder: Path, text: str, better: float = 0.5) -> Path:
    """A scenario in `folder` with a model of folds beside it, whose held-out error is `better` times the nominal
    one's.
    """
    path = folder / "steps.toml"
    path.write_text(text + OFFER, encoding="utf-8")
    base = kind_for(load_track_scenario(path).belief, []).nominal()
    stages = {"nominal": base, "calibrated": base, "augmented": base | FOLDS}
    (folder / "model.toml").write_text(Model("magnetic", stages).to_toml(), encoding="utf-8")
    errors = {"nominal": 1e-3, "calibrated": 1e-3, "augmented": 1e-3 * better}
    (folder / "report.json").write_text(json.dumps({"error": {"holdout": errors}}), encoding="utf-8")
    return path


def tracked(scenario: TrackScenario, offer: Offer | None, controller: str) -> LoopTrace:
    return run_loop(scenario, believed_model(scenario, Theta()), controller, 1, offer=offer)


@pytest.mark.parametrize("controller", ["feedforward", "mpc"])
def test_a_better_model_takes_over_at_a_rest_without_a_jump_and_tracks_better(tmp_path: Path, controller: str) -> None:
    path = offered(tmp_path, STEPS.replace("4.0, 12.0]", "4.0]").format(seconds=8.0))
    scenario = load_track_scenario(path)
    found = read_offer(scenario.offer, tmp_path, scenario.belief, Theta())
    assert found is not None
    offer = Offer(believed_model(scenario, found.values), Acceptance(), found.at_s)
    with_it, without = tracked(scenario, offer, controller), tracked(scenario, None, controller)
    taken = with_it.taken_at
    assert taken > 1.5
    assert scenario.reference.speed(np.array([taken - 0.19, taken])).max() < 2e-4
    before = with_it.time_s < taken
    assert np.array_equal(with_it.command[before], without.command[before])
    steps = np.abs(np.diff(with_it.command))[np.count_nonzero(before) - 1 :]
    assert steps[0] < 5e-6
    assert (
        np.abs(np.diff(steps[:100])).max()
        <= 1.01 * scenario.limits.carriage_acceleration_m_s2 * scenario.control.tick_s**2
    )

    def error(trace: LoopTrace) -> float:
        t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
        later = t > taken + 0.5
        return float(np.sqrt(np.mean((x - scenario.reference.position(t))[later] ** 2)))

    assert error(with_it) < 0.7 * error(without)
    assert [event.reason for event in with_it.events][-1] == "new model"


def test_the_tick_that_takes_a_model_makes_nothing_of_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = offered(tmp_path, STEPS.replace("4.0, 12.0]", "4.0]").format(seconds=8.0))
    scenario = load_track_scenario(path)
    found = read_offer(scenario.offer, tmp_path, scenario.belief, Theta())
    assert found is not None
    offer = Offer(believed_model(scenario, found.values), Acceptance(), found.at_s)
    made: list[Estimator] = []
    begin, take = Monitor.__init__, ModelSwitch._take_over
    during: list[int] = []

    def counted(self: Monitor, estimator: Estimator) -> None:
        made.append(estimator)
        begin(self, estimator)

    def took(self: ModelSwitch, prepared: Prepared, now: float) -> None:
        before = len(made)
        take(self, prepared, now)
        during.append(len(made) - before)

    monkeypatch.setattr(Monitor, "__init__", counted)
    monkeypatch.setattr(ModelSwitch, "_take_over", took)
    assert tracked(scenario, offer, "feedforward").taken_at > 1.5
    assert (len(made), during) == (2, [0])


def test_a_model_in_use_that_its_report_does_not_know_and_a_worse_one_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = offered(tmp_path, STEPS.format(seconds=13.0), better=1.2)
    assert run(["track", str(path)]) == 2
    assert (
        "offered model must pass the acceptance test; got: held-out error must be at most 0.99"
        in capsys.readouterr().err
    )
    path = offered(tmp_path, STEPS.format(seconds=13.0))
    scenario = load_track_scenario(path)
    base = kind_for(scenario.belief, []).nominal()
    with pytest.raises(ValueError, match="held-out error of the current model must be known on the same records"):
        read_offer(scenario.offer, tmp_path, scenario.belief, base | {"f_c": 0.03})
    for wrong, sentence in (
        ('stage = "augmnted"', "did you mean 'augmented'"),
        ("at_s = -1", "offer.at_s must be zero or more"),
        ('fil = "a"', "keys of [offer] must be among file, report, stage, at_s"),
    ):
        path.write_text(STEPS.format(seconds=13.0) + OFFER.replace("at_s = 1.5", wrong), encoding="utf-8")
        assert run(["track", str(path)]) == 2
        assert sentence in capsys.readouterr().err


def test_over_the_bus_it_is_taken_told_and_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = STEPS.replace("12.0, 4.0, 12.0]", "6.0]").format(seconds=5.0)
    path = offered(tmp_path, short)
    assert run(["sil", str(path), "--out", str(tmp_path / "out"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert 1.5 < found["offer"]["taken_at_s"] < 2.5
    assert found["events"][-1]["reason"] == "new model"
    assert found["hard_violations"] == 0
    (tmp_path / "model.toml").unlink()
    assert run(["replay", found["log"]]) == 0


def test_a_deployment_keeps_it_for_the_controller(tmp_path: Path) -> None:
    offered(tmp_path, STEPS.format(seconds=13.0))
    found = load_deployment(Path(rig_file(tmp_path, deployment("offer", more=OFFER))))
    assert found.task().offer is not None
    assert found.task().offer.at_s == 1.5
