"""The experiment of a run that learns: within what the file allows, driven at a rest, the same in a replay."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.reference import Experiment
from hil.app.learn.learner import experiment_of
from hil.app.main import run as capsule
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.scenario.deployment_tables import LearningTable
from hil.app.sil.loop import SilTrace, judged_loop, run_sil
from hil.app.sil.testbed import believed_on_bus
from hil.log.log import LockstepLog
from hil.log.recorder import Recorder, log_record
from hil.nodes.frame_map import frames
from hil.nodes.node import ControllerNode
from models.files.toml import parse_toml
from models.theta import Theta
from plant import layout as at

THERE_AND_BACK = Experiment((0.0, 0.5, 1.0), (0.0, 1.5e-3, 0.0), 1.0)
SCENARIO = """
[scenario]
name = "interrupted"
duration_s = 4.0
[rig]
kind = "magnetic"
[reference]
kind = "steps"
positions_mm = [2.0, 0.0]
speed_mm_s = 4.0
dwell_s = 1.0
start_s = 0.2
[control]
controller = "feedforward"
judged_from_s = 0.2
"""


@dataclass
class Asks:
    """In a learner's place: has one experiment driven at the first tick."""

    node: ControllerNode
    experiment: Experiment
    lessons: list[Any] = field(default_factory=list)
    offers: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.node.drive(self.experiment)

    def step(self, *told: object) -> None:
        """Nothing to learn."""

    @property
    def record(self) -> dict[str, Any]:
        return {"learned": [], "experiments": [self.experiment.document()]}


def driven(experiment: Experiment, folder: Path, text: str = SCENARIO) -> tuple[SilTrace, Any]:
    scenario = parse_sil_scenario(parse_toml(text, "scenario"))
    record = log_record({"scenario": text}, "feedforward", Theta(), scenario.loop.limits, frames(), seed=1)
    with LockstepLog(folder / "frames.blf", record) as log:
        learning: Any = lambda node: Asks(node, experiment)  # noqa: E731
        model = believed_on_bus(scenario, Theta())
        trace = run_sil(scenario, model, "feedforward", 1, recorder=Recorder(log), learning=learning)
        log.add_to_record(trace.learned)
    return trace, scenario


def test_it_is_driven_at_the_next_rest_and_replayed_alike(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trace, scenario = driven(THERE_AND_BACK, tmp_path)
    (begin,) = trace.experiments_at
    assert 1.0 <= begin < 1.3, "the reference rests at 2 mm from 0.7 s on for a second"
    loop = judged_loop(scenario, trace)
    t, x = trace.rows[:, at.O_T], trace.rows[:, at.O_X]
    assert np.max(loop.reference.position(t)) == pytest.approx(3.5e-3, abs=1e-4)
    assert np.max(x[t < 1.0]) < 2.3e-3
    assert np.max(x) > 3.0e-3
    assert np.sqrt(np.mean((x - loop.reference.position(t))[t > 0.5] ** 2)) < 0.3e-3
    assert capsule(["replay", str(tmp_path / "frames.blf"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["identical"]


def test_beyond_the_travel_allowed_and_under_way_it_is_not_driven(tmp_path: Path) -> None:
    narrow = SCENARIO + "[limits]\ntravel_m = 0.003\n"
    far, _ = driven(THERE_AND_BACK, tmp_path, narrow)
    late, _ = driven(replace(THERE_AND_BACK, at_s=3.9), tmp_path)
    assert far.experiments_at == []
    assert np.max(far.rows[:, at.O_X]) < 2.4e-3
    assert len(late.experiments_at) <= 1


@given(
    reach=st.floats(0.1, 20.0),
    speed=st.floats(0.5, 10.0),
    longest=st.floats(4.0, 60.0),
    places=st.lists(st.floats(-0.1, 0.1), min_size=0, max_size=8),
)
def test_an_experiment_stays_within_its_pace(reach: float, speed: float, longest: float, places: list[float]) -> None:
    motion = tuple(float(k) for k in range(len(places) + 1)) if places else (), tuple([0.0, *places] if places else [])
    learning = LearningTable(experiment_mm=reach, experiment_mm_s=speed, experiment_s=longest)
    experiment = experiment_of(motion, learning, 3.0)
    assert experiment is not None
    assert np.max(np.abs(experiment.path.positions)) <= 1e-3 * reach * (1 + 1e-9)
    assert experiment.path.positions[-1] == pytest.approx(0.0, abs=1e-9)
    assert experiment.at_s == 3.0


def test_none_is_made_where_none_is_allowed() -> None:
    assert experiment_of(((), ()), LearningTable(), 3.0) is None
