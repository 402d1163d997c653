"""A run of a closed loop: what the tables of a scenario, its seed and the controller's model lead to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from controller.model.control_model import ControlModel
from hil.app.scenario.bus_scenario import SilScenario, parse_sil_scenario
from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.sil.command import judged
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import document, score
from models.theta import Theta

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Loop:
    """One run: its number, the scenario as tables, its seed, and what sets it apart (`point`)."""

    number: int
    engine: str
    raw: Table
    seed: int
    point: Table
    values: Theta
    stage: str

    def result(self) -> dict[str, Any]:
        """What the engine prints of this run. Raises ValueError for a scenario that cannot be run."""
        return _tracked(self) if self.engine == "track" else _over_the_bus(self)


def _tracked(job: Loop) -> dict[str, Any]:
    scenario = parse_track_scenario(job.raw)
    name = scenario.control.controller
    trace = run_loop(scenario, _track_model(_Known(scenario, job.values)), name, job.seed)
    return document(scenario, scenario.name, name, job.seed, job.stage, score(scenario, trace), None)


def _over_the_bus(job: Loop) -> dict[str, Any]:
    scenario = parse_sil_scenario(job.raw)
    found, _ = judged(scenario, _sil_model(_Known(scenario, job.values)), None, job.seed, job.stage)
    return found


class _Known:
    """A scenario by what its model depends on: belief, tick, learned values; so runs of one belief share a model."""

    def __init__(self, scenario: TrackScenario | SilScenario, values: Theta) -> None:
        loop = scenario.loop if isinstance(scenario, SilScenario) else scenario
        self.scenario, self.values = scenario, values
        self._key = (repr(loop.belief), loop.control.tick_s, tuple(sorted(values.items())))

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self._key == other._key


@lru_cache(maxsize=8)
def _track_model(known: _Known) -> ControlModel:
    assert isinstance(known.scenario, TrackScenario)
    return believed_model(known.scenario, known.values)


@lru_cache(maxsize=8)
def _sil_model(known: _Known) -> ControlModel:
    assert isinstance(known.scenario, SilScenario)
    return believed_on_bus(known.scenario, known.values)
