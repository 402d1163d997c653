"""A run of a closed loop: what the tables of a scenario, its seed and the controller's model lead to."""

from collections.abc import Mapping
from dataclasses import dataclass
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
_MODELS: dict[Any, ControlModel] = {}
_MOST_MODELS = 8  # that are kept


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
            return judged(over_bus, _model(over_bus, self.values), None, self.seed, self.stage)[0]
        scenario = parse_track_scenario(self.raw)
        name = scenario.control.controller
        trace = run_loop(scenario, _model(scenario, self.values), name, self.seed)
        return document(scenario, name, self.seed, self.stage, score(scenario, trace))


def _model(scenario: TrackScenario | SilScenario, values: Theta) -> ControlModel:
    """The control model, which runs of one belief, tick and learned values share."""
    loop = scenario.loop if isinstance(scenario, SilScenario) else scenario
    key = (type(scenario), repr(loop.belief), loop.control.tick_s, tuple(sorted(values.spelled().items())))
    if key not in _MODELS:
        if len(_MODELS) >= _MOST_MODELS:
            del _MODELS[next(iter(_MODELS))]
        if isinstance(scenario, SilScenario):
            _MODELS[key] = believed_on_bus(scenario, values)
        else:
            _MODELS[key] = believed_model(scenario, values)
    return _MODELS[key]
