"""The log of an exported controller: a lockstep run over the simulated bus, what its C functions got and answered."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from controller.model.control_model import ControlModel
from controller.step.library import READINGS, Library
from hil.app.scenario.bus_scenario import SilScenario, check_slots
from hil.app.scenario.deployment import Deployment
from hil.app.scenario.scenario import Control, TrackScenario, load_track_scenario, parse_track_scenario
from hil.app.sil.testbed import Bench
from models.files.toml import parse_toml
from models.rigs.reader import table_names
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
MOST_TICKS: Final = 2500
"""Ticks of a log, the first ones of the run."""
LISTENS, BEGINS, CONTROLS = range(3)
"""Phases of a tick: the estimator alone, the controller begins, the controller goes on."""
_IN_PLANT: Final = {
    "force_constant_N_per_A": "gain_N_per_A",
    "coil_resistance_Ohm": "resistance_ohm",
    "coil_inductance_H": "inductance_H",
}
"""Keys of a rig file that a plant's scenario spells otherwise."""
_LEAST_S: Final = 1.0
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
        loop = _believed_plant(raw, duration_s)
        seen = replace(loop.instruments.localisation, std=control.seen_noise_m, quantum=control.resolution_m)
        loop = replace(loop, instruments=replace(loop.instruments, localisation=seen))
    led = Control(tick_s=control.tick_s, controller=control.controller, judged_from_s=_LEAST_S / 2, probe=control.probe)
    loop = replace(loop, duration_s=duration_s, belief=deployment.rig, reference=deployment.reference, control=led)
    return SilScenario(replace(loop, limits=deployment.limits))


def _believed_plant(raw: Mapping[str, Any], duration_s: float) -> TrackScenario:
    """A plant of the numbers of a rig file. Raises ValueError where it has keys that no plant has."""
    own = {name: dict(raw[name]) for name in table_names() if name in raw and name != "noise"}
    rig = {_IN_PLANT.get(name, name): value for name, value in own.pop("rig").items()}
    try:
        run = {"scenario": {"duration_s": duration_s}, "reference": {"kind": "hold"}}
        return parse_track_scenario({**own, **run, "rig": rig})
    except ValueError as error:
        raise ValueError(TEXT("controller.unlike", why=error)) from None


def logged(scenario: SilScenario, model: ControlModel, controller: str, library: Library) -> str:
    """`ticks.csv` of a run of `scenario` with the compiled controller. Raises ValueError where it does not lead."""
    log = TickLog(library)
    with log.kept():
        bench = Bench(scenario, model, controller, scenario.loop.seed)
        bench.start()
        for _ in range(round(scenario.loop.duration_s / bench.tick_s)):
            bench.begin_tick()
            for number in range(bench.slots):
                bench.slot(number)
            bench.end_tick()
    if not any(row[0] for row in log.rows):
        why = bench.node.reason or "the drive was not enabled"
        raise ValueError(TEXT("controller.lead", why=why))
    return log.text()


class TickLog:
    """Stands for the functions of a compiled controller; `rows` of `ticks.csv`: what each tick got and answered."""

    def __init__(self, library: Library) -> None:
        self._library, self._functions = library, library.functions
        self._start: tuple[float, float] = (0.0, 0.0)
        self._begin: tuple[float, float] | None = None
        stages = range(library.stages + 1)
        readings = (f"{what}_{k}" for k in range(READINGS) for what in ("stamp_s", "value", "channel"))
        path = (f"{what}_{k}{unit}" for what, unit in (("position", "_m"), ("speed", "_m_s")) for k in stages)
        more = ("next_speed_m_s", "least", "most", "temperature_C", "command", "believed_m")
        first = ("phase", "begin_s", "begin_command", "time_s", "readings")
        self.header = (*first, *readings, "in_force", "halt", *path, *more)
        self.rows: list[list[float]] = []

    def text(self) -> str:
        """The log as CSV, each number such that it is read back to the last bit."""
        rows = (",".join(repr(float(value)).removesuffix(".0") for value in row) for row in self.rows[:MOST_TICKS])
        return "\n".join([",".join(self.header), *rows]) + "\n"

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Within it a controller that is built keeps its calls here."""
        self._library.functions = self  # type: ignore[assignment]
        try:
            yield
        finally:
            self._library.functions = self._functions

    def __getattr__(self, name: str) -> Any:
        return getattr(self._functions, name)

    def capsule_estimator_init(self, at: Any, numbers: Any, begin_s: Any, command: Any) -> None:
        """The estimator begins, and with it the log."""
        self._functions.capsule_estimator_init(at, numbers, begin_s, command)
        self.rows.clear()
        self._start = begin_s.value, command.value

    def capsule_estimate(self, at: Any, given: Any) -> None:
        self._functions.capsule_estimate(at, given)
        belief, given = self._library.Belief.from_buffer(at._obj, self._library.belief_at), given._obj
        row = [LISTENS, *(self._start if not self.rows else (0.0, 0.0)), given.time_s, given.readings]
        for k in range(READINGS):
            reading = given.reading[k]
            row += [reading.stamp_s, reading.value, reading.channel] if k < given.readings else [0.0, 0.0, 0]
        row += [given.in_force]
        self.rows.append([*row, *[0.0] * (len(self.header) - len(row) - 1), belief.state[0]])

    def capsule_controller_init(self, at: Any, numbers: Any, begin_s: Any, belief: Any, command: Any) -> None:
        """The controller begins with its next tick."""
        self._functions.capsule_controller_init(at, numbers, begin_s, belief, command)
        self._begin = begin_s.value, command.value

    def capsule_control(self, at: Any, belief: Any, given: Any, out: Any) -> None:
        self._functions.capsule_control(at, belief, given, out)
        row, given = self.rows[-1], given._obj
        row[0] = CONTROLS if self._begin is None else BEGINS
        row[1:3] = self._begin or row[1:3]
        path = (*given.position_m, *given.speed_m_s)
        numbers = (given.next_speed_m_s, given.least, given.most, given.temperature_C, out._obj.command)
        answer = [given.halt, *path, *numbers]
        row[-len(answer) - 1 : -1] = answer
        self._begin = None
