"""The log of an exported controller: a lockstep run over the simulated bus, what its C functions got and answered."""

import ctypes
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from controller.model.control_model import ControlModel
from controller.step.library import READINGS, Library, Out
from hil.app.scenario.bus_scenario import SilScenario, check_slots
from hil.app.scenario.deployment import Deployment
from hil.app.scenario.scenario import Control, load_track_scenario, parse_track_scenario
from hil.app.sil.testbed import Bench
from models.files.toml import parse_toml
from models.rigs.reader import table_names

MOST_TICKS: Final = 5000
"""Ticks of a log, the first ones of the run."""
LISTENS, BEGINS, CONTROLS = range(3)
"""Phases of a tick: the estimator alone, the controller begins with the command in force, the controller goes on."""
_LEAST_S: Final = 0.5
"""Shortest run that is simulated: the drive is enabled within it."""


def closed_loop(deployment: Deployment, path: Path) -> SilScenario:
    """The deployment's controller before the plant that its file names, else before its rig as it is believed. Raises
    ValueError of one sentence.
    """
    raw, control = parse_toml(deployment.text, "rig file"), deployment.control
    check_slots(control.tick_s)
    duration_s = max(min(control.duration_s, MOST_TICKS * control.tick_s), _LEAST_S)
    if "plant" in raw:
        loop = load_track_scenario(path.parent / raw["plant"]["scenario"])
    else:
        own = {name: table for name, table in raw.items() if name in table_names() and name != "noise"}
        loop = parse_track_scenario({**own, "scenario": {"duration_s": duration_s}, "reference": raw["reference"]})
    led = Control(tick_s=control.tick_s, controller=control.controller, judged_from_s=0.0, estimator=control.estimator)
    loop = replace(loop, duration_s=duration_s, belief=deployment.rig, reference=deployment.reference, control=led)
    return SilScenario(replace(loop, limits=deployment.limits))


class TickLog:
    """Rows of `ticks.csv`: the inputs of each tick and what the C functions answered."""

    def __init__(self, library: Library) -> None:
        self._library = library
        stages = range(library.stages + 1)
        readings = (f"{what}_{k}" for k in range(READINGS) for what in ("stamp_s", "value", "channel"))
        path = (f"{what}_{k}{unit}" for what, unit in (("position", "_m"), ("speed", "_m_s")) for k in stages)
        more = ("next_speed_m_s", "most", "temperature_C", "command", "believed_m")
        self.header = ("phase", "time_s", "readings", *readings, "in_force", "halt", *path, *more)
        self.rows: list[list[float]] = []

    def text(self) -> str:
        """The log as CSV, each number such that it is read back to the last bit."""
        lines = [",".join(self.header), *(",".join(map(_shortest, row)) for row in self.rows[:MOST_TICKS])]
        return "\n".join(lines) + "\n"

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Within it every call of the library's functions is kept."""
        functions = self._library.functions
        self._library.functions = _Tapped(functions, self)
        try:
            yield
        finally:
            self._library.functions = functions

    def estimated(self, given: Any, belief_m: float) -> None:
        given = given._obj
        readings = [
            number
            for k in range(READINGS)
            for number in (
                (given.reading[k].stamp_s, given.reading[k].value, given.reading[k].channel)
                if k < given.readings
                else (0.0, 0.0, 0)
            )
        ]
        self.rows.append([LISTENS, given.time_s, given.readings, *readings, given.in_force])


def _shortest(value: float) -> str:
    return str(int(value)) if math.isfinite(value) and value == int(value) and abs(value) < 1e9 else repr(float(value))
