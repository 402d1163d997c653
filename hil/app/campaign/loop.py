"""A run of a closed loop: what the tables of a scenario, its seed and the controller's model lead to."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from controller.model.control_model import ControlModel
from hil.app.scenario.bus_scenario import SilScenario, parse_sil_scenario
from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.sil.sil import judged
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
        if self.engine == "sil":
            over_bus = parse_sil_scenario(self.raw)
            return judged(over_bus, _model(_Known(over_bus, self.values)), None, self.seed, self.stage)[0]
        scenario = parse_track_scenario(self.raw)
        name = scenario.control.controller
        trace = run_loop(scenario, _model(_Known(scenario, self.values)), name, self.seed)
        return document(scenario, name, self.seed, self.stage, score(scenario, trace))


class _Known:
    """A scenario by what its model depends on: belief, tick, learned values; so runs of one belief share a model."""

    def __init__(self, scenario: TrackScenario | SilScenario, values: Theta) -> None:
        loop = scenario.loop if isinstance(scenario, SilScenario) else scenario
        self.scenario, self.values = scenario, values
        self._key = (type(scenario), repr(loop.belief), loop.control.tick_s, tuple(sorted(values.spelled().items())))

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self._key == other._key


@lru_cache(maxsize=8)
def _model(known: _Known) -> ControlModel:
    scenario, values = known.scenario, known.values
    if isinstance(scenario, SilScenario):
        return believed_on_bus(scenario, values)
    return believed_model(scenario, values)
