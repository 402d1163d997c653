"""The rig, its models and the panels of the page; each line of a panel shows signals of a frame."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from hil.app.cockpit.phrases import TEXT, grade_of, tips, words
from hil.app.scenario.model_use import model_facts
from hil.bus.catalogue import FrameCatalogue
from hil.bus.codec import without_absent
from hil.nodes.frame_map import CARRIAGE_MAP, FRAME_MAPS, FrameMap
from hil.nodes.task import Task

Values = Mapping[str, float]
Span = tuple[float, float]
STDS: Final = 2.0
"""Half the width of the estimate's band, in standard deviations."""
_MM, _MN, _PERCENT = 1e3, 1e3, 100.0  # in a metre; mN in a newton


@dataclass(frozen=True)
class Line:
    """At each good `frame`, `of(its values, last values of all frames)` gives the smallest and the largest value in the
    unit of the panel, or None; `names` are those of a strip of states; `tip` is the key of its tooltip.
    """

    name: str
    frame: str
    of: Callable[[Values, Mapping[str, Values]], Span | None]
    colour: str
    look: str = "line"
    names: Mapping[int, str] | None = None
    tip: str = "state"


@dataclass(frozen=True)
class LivePanel:
    """Lines over one axis: decimal `places` of readings, smallest `span` shown, dashed `marks`. `tip` and `marked` are
    the keys of its tooltip and of what the marks mean.
    """

    title: str
    tip: str
    unit: str
    lines: tuple[Line, ...]
    places: int = 2
    span: float = 0.0
    marks: tuple[float, ...] = ()
    marked: str = ""
    strips: bool = False

    def document(self) -> dict[str, Any]:
        lines: list[dict[str, Any]] = []
        for one in self.lines:
            names: Any = one.names and {raw: [words(state), grade_of(state)] for raw, state in one.names.items()}
            look = {"name": one.name, "colour": one.colour, "look": one.look, "names": names}
            lines.append({**look, "tip": TEXT(f"line.{one.tip}")})
        axis = {"title": self.title, "unit": self.unit, "places": self.places, "span": self.span}
        marks = {"marks": list(self.marks), "marked": self.marked and TEXT(f"mark.{self.marked}")}
        return {**axis, **marks, "tip": TEXT(f"panel.{self.tip}"), "strips": self.strips, "lines": lines}


def panels_of(frame_map: FrameMap, catalogue: FrameCatalogue) -> tuple[LivePanel, ...]:
    drive = frame_map.drive
    word, unit, factor, _ = drive.shown
    seen = _signal(frame_map.signal, factor)
    reported = () if drive.shaken else (Line("reported", frame_map.feedback, seen, "blue", tip="reported"),)

    def strip(name: str, frame: str, signal: str) -> Line:
        names = catalogue[frame].field(signal).names
        return Line(name, frame, _signal(signal), signal.lower(), "strip", names)

    positions = (
        _line("localisation", "CapsuleLocalisation", "Position_m", _MM, "grey", "faint", "localisation"),
        Line(f"estimate ± {STDS:g}σ", "BelievedMotion", _band, "teal", "band", tip="band"),
        _line("estimate", "BelievedMotion", "Position_m", _MM, "teal", tip="estimate"),
        Line("reference", "WantedMotion", _wanted, "amber", "dash", tip="reference"),
    )
    forces = (
        _line("force sensor", "ForceReading", "Force_N", _MN, "grey", "faint", "force_sensor"),
        *(() if drive.shaken else (Line("drive", "BelievedForces", _force("Drive_N"), "blue", tip="drive_force"),)),
        Line("wall", "BelievedForces", _force("Wall_N"), "red", tip="wall_force"),
        Line("lacking in the model", "BelievedForces", _force("Lacking_N"), "violet", tip="lacking"),
    )
    error = Line("error", "WantedMotion", _error, "red", tip="error")
    command = Line("command", frame_map.command, seen, "amber", "dash", tip="command")
    innovation = _line("innovation", "BelievedMotion", "Surprise", 1.0, "blue", tip="innovation")
    evidence = _line("evidence", "ModelHealth", "Evidence", _PERCENT, "red", tip="evidence")
    states = (
        strip("controller", "ControllerHeartbeat", "State"),
        strip(frame_map.node.lower(), frame_map.feedback, "State"),
        strip("wall", "BelievedMotion", "Wall"),
        strip("model", "ModelHealth", "State"),
    )
    return (
        LivePanel("Position", "position", "mm", positions, 3, 1.0),
        LivePanel("Estimate minus reference", "error", "mm", (error,), 3, 0.1, (0.0,)),
        LivePanel(word, "command", unit, (*reported, command), 3, 0.01),
        LivePanel("Forces on the capsule", "forces", "mN", forces, 1, 2.0, (0.0,)),
        LivePanel("Innovation", "innovation", "σ", (innovation,), 1, 6.0, (-3.0, 3.0), "usual"),
        LivePanel("Evidence against the model", "evidence", "%", (evidence,), 0, 110.0, (100.0,), "broken"),
        LivePanel("States", "states", "", states, strips=True),
    )


def _signal(name: str, factor: float = 1.0) -> Callable[[Values, Mapping[str, Values]], Span | None]:
    def of(values: Values, _: Mapping[str, Values]) -> Span:
        return factor * values[name], factor * values[name]

    return of


def _line(name: str, frame: str, signal: str, factor: float, colour: str, look: str = "line", tip: str = "") -> Line:
    """A line of a signal, with gaps where the signal is absent."""

    def of(values: Values, _: Mapping[str, Values]) -> Span | None:
        value = factor * without_absent(frame, values)[signal]
        return None if math.isnan(value) else (value, value)

    return Line(name, frame, of, colour, look, tip=tip)


def _lost(values: Values) -> bool:
    return values["Wall"] == 3


def _band(values: Values, _: Mapping[str, Values]) -> Span | None:
    middle, half = _MM * values["Position_m"], _MM * STDS * values["Std_m"]
    return None if _lost(values) else (middle - half, middle + half)


def _force(name: str) -> Callable[[Values, Mapping[str, Values]], Span | None]:
    """Estimated forces while the estimate is not lost."""

    def of(values: Values, last: Mapping[str, Values]) -> Span | None:
        if "BelievedMotion" not in last or _lost(last["BelievedMotion"]):
            return None
        return _MN * values[name], _MN * values[name]

    return of


def _wanted(values: Values, _: Mapping[str, Values]) -> Span | None:
    position = _MM * values["Position_m"]
    return (position, position) if values["Following"] else None


def _error(values: Values, last: Mapping[str, Values]) -> Span | None:
    """Estimate less reference of one tick, as BelievedMotion is sent before WantedMotion."""
    motion = last.get("BelievedMotion")
    if motion is None or _lost(motion) or not values["Following"]:
        return None
    off = _MM * (motion["Position_m"] - values["Position_m"])
    return off, off


@dataclass(frozen=True)
class Facts:
    """The source, its drive, and the models where known, in the order in which they may come into use."""

    title: str
    about: str
    frame_map: FrameMap
    catalogue: FrameCatalogue
    models: tuple[dict[str, Any], ...] = ()

    def document(self) -> dict[str, Any]:
        return {
            "title": self.title,
            "about": self.about,
            "models": list(self.models),
            "tips": tips(),
            "panels": [panel.document() for panel in panels_of(self.frame_map, self.catalogue)],
        }


def models_of(task: Task) -> tuple[dict[str, Any], ...]:
    """Effects and parameters of the models of a task, in the order in which they come into use."""
    offers = [offer for offer in (task.offer, *task.learned) if offer is not None]
    return tuple(model_facts(model) for model in (task.model, *(offer.model for offer in offers)))


def frame_map_in(heard: Collection[str]) -> FrameMap:
    """The frame map of the drive whose feedback was heard, for a log without a record; else a carriage's."""
    return next((frame_map for frame_map in FRAME_MAPS.values() if frame_map.feedback in heard), CARRIAGE_MAP)
