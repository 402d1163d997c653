"""The rig, its models and the panels of the page; each line of a panel shows signals of a frame."""

import math
from collections.abc import Collection, Mapping, Sequence
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
STDS: Final = 2.0  # Half the width of the estimate's band, in standard deviations
_MOTION: Final = "BelievedMotion"
_MM, _MN, _PERCENT = 1e3, 1e3, 100.0  # in a metre; mN in a newton


@dataclass(frozen=True)
class Line:
    """The `signal` of each good `frame` times `factor`, in the unit of the panel; the look "band" adds the estimate's
    deviation, "error" is the estimate less the signal. `names` are those of a strip of states; `tip` is the key of its
    tooltip.
    """

    name: str
    frame: str
    signal: str
    colour: str
    look: str = "line"
    factor: float = 1.0
    tip: str = "state"
    names: Mapping[int, str] | None = None

    def value(self, values: Values, last: Mapping[str, Values]) -> Span | None:
        """The smallest and the largest value at a frame, from its values and the last ones of all frames; None without
        any: a signal that is absent, no estimate for its forces or its error, a reference that is not followed.
        """
        seen, middle, half = without_absent(self.frame, values), math.nan, 0.0
        if self.tip == "error" or self.frame == "BelievedForces":
            believed = without_absent(_MOTION, last.get(_MOTION, {})).get("Position_m", math.nan)
            if self.tip == "error":  # of one tick, as BelievedMotion is sent before WantedMotion
                middle = believed - seen[self.signal]
            elif not math.isnan(believed):
                middle = seen[self.signal]
        else:
            middle = seen[self.signal]
        if self.look == "band":
            half = STDS * self.factor * seen["Std_m"]
        middle = self.factor * middle if values.get("Following", 1.0) else math.nan
        return None if math.isnan(middle) else (middle - half, middle + half)


@dataclass(frozen=True)
class LivePanel:
    """Lines over one axis: decimal `places` of readings, smallest `span` shown, dashed `marks`. `tip` and `marked` are
    the keys of its tooltip and of what the marks mean.
    """

    title: str
    tip: str
    unit: str
    lines: Sequence[Line]
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
    drive, feedback = frame_map.drive, frame_map.feedback
    word, unit, factor, _ = drive.shown
    states = [("controller", "ControllerHeartbeat", "State"), (frame_map.node.lower(), feedback, "State")]
    states += [("wall", _MOTION, "Wall"), ("model", "ModelHealth", "State")]
    strips = [
        Line(name, frame, signal, signal.lower(), "strip", names=catalogue[frame].field(signal).names)
        for name, frame, signal in states
    ]
    position = [
        Line("localisation", "CapsuleLocalisation", "Position_m", "grey", "faint", _MM, "localisation"),
        Line(f"estimate ± {STDS:g}σ", _MOTION, "Position_m", "teal", "band", _MM, "band"),
        Line("estimate", _MOTION, "Position_m", "teal", "line", _MM, "estimate"),
        Line("reference", "WantedMotion", "Position_m", "amber", "dash", _MM, "reference"),
    ]
    forces = [
        Line("force sensor", "ForceReading", "Force_N", "grey", "faint", _MN, "force_sensor"),
        Line("drive", "BelievedForces", "Drive_N", "blue", "line", _MN, "drive_force"),
        Line("wall", "BelievedForces", "Wall_N", "red", "line", _MN, "wall_force"),
        Line("lacking in the model", "BelievedForces", "Lacking_N", "violet", "line", _MN, "lacking"),
    ]
    error = Line("error", "WantedMotion", "Position_m", "red", "line", _MM, "error")
    drives = [
        Line("reported", feedback, frame_map.signal, "blue", "line", factor, "reported"),
        Line("command", frame_map.command, frame_map.signal, "amber", "dash", factor, "command"),
    ]
    if drive.shaken:  # its feedback has no level, and its force is none on the capsule alone
        del drives[0], forces[1]
    innovation = Line("innovation", _MOTION, "Surprise", "blue", tip="innovation")
    evidence = Line("evidence", "ModelHealth", "Evidence", "red", "line", _PERCENT, "evidence")
    return (
        LivePanel("Position", "position", "mm", position, 3, 1.0),
        LivePanel("Estimate minus reference", "error", "mm", [error], 3, 0.1, (0.0,)),
        LivePanel(word, "command", unit, drives, 3, 0.01),
        LivePanel("Forces on the capsule", "forces", "mN", forces, 1, 2.0, (0.0,)),
        LivePanel("Innovation", "innovation", "σ", [innovation], 1, 6.0, (-3.0, 3.0), "usual"),
        LivePanel("Evidence against the model", "evidence", "%", [evidence], 0, 110.0, (100.0,), "broken"),
        LivePanel("States", "states", "", strips, strips=True),
    )


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
