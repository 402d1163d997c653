"""The rig, its models and the panels of the page; each line of a panel shows signals of a frame."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from hil.app.cockpit.phrases import TEXT, grade_of, words
from hil.app.scenario.model_use import model_facts
from hil.bus.catalogue import FrameCatalogue
from hil.bus.codec import without_absent
from hil.nodes.frame_map import CARRIAGE_MAP, FRAME_MAPS, FrameMap
from hil.nodes.task import Task
from models.files.toml import beside

Values = Mapping[str, float]
Span = tuple[float, float]
STDS: Final = 2.0  # Half the width of the estimate's band, in standard deviations
_MOTION: Final = "BelievedMotion"
_PANELS: Final = beside(__file__, "panels.toml")["panel"]


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

    def document(self) -> dict[str, Any]:
        names: Any = self.names and {raw: [words(state), grade_of(state)] for raw, state in self.names.items()}
        look = {"name": self.name, "colour": self.colour, "look": self.look, "names": names}
        return {**look, "tip": TEXT(f"line.{self.tip}")}


@dataclass(frozen=True)
class LivePanel:
    """`lines` over one axis, which the `table` describes: decimal `places` of readings, smallest `span` shown, dashed
    `marks`. `tip` and `marked` are the keys of its tooltip and of what the marks mean.
    """

    table: Mapping[str, Any]
    lines: Sequence[Line]

    def document(self) -> dict[str, Any]:
        plain = {"places": 2, "span": 0.0, "marks": [], "marked": "", "strips": False, **self.table}
        said = {"marked": plain["marked"] and TEXT(f"mark.{plain['marked']}"), "tip": TEXT(f"panel.{plain['tip']}")}
        return {**plain, **said, "lines": [line.document() for line in self.lines]}


def panels_of(frame_map: FrameMap, catalogue: FrameCatalogue) -> tuple[LivePanel, ...]:
    word, unit, factor, _ = frame_map.drive.shown
    own = {"word": word, "unit": unit, "factor": f"{factor}", "signal": frame_map.signal}
    own |= {"node": frame_map.node.lower(), "feedback": frame_map.feedback, "command": frame_map.command}

    def filled(table: Mapping[str, Any]) -> dict[str, Any]:
        return {key: text.format(**own) if isinstance(text, str) else text for key, text in table.items()}

    def line(*, frame: str, signal: str, level: bool = False, factor: float | str = 1.0, **look: Any) -> Iterator[Line]:
        names = catalogue[frame].field(signal).names if look.get("look") == "strip" else None
        if not (level and frame_map.drive.shaken):
            yield Line(frame=frame, signal=signal, factor=float(factor), names=names, **look)

    lines = [[one for table in panel["lines"] for one in line(**filled(table))] for panel in _PANELS]
    return tuple(map(LivePanel, map(filled, _PANELS), lines))


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
            "tips": {name: TEXT(f"tip.{name}") for name in beside(__file__, "sentences.toml")["tip"]},
            "panels": [panel.document() for panel in panels_of(self.frame_map, self.catalogue)],
        }


def models_of(task: Task) -> tuple[dict[str, Any], ...]:
    """Effects and parameters of the models of a task, in the order in which they come into use."""
    offers = [offer for offer in (task.offer, *task.learned) if offer is not None]
    return tuple(model_facts(model) for model in (task.model, *(offer.model for offer in offers)))


def frame_map_in(heard: Collection[str]) -> FrameMap:
    """The frame map of the drive whose feedback was heard, for a log without a record; else a carriage's."""
    return next((frame_map for frame_map in FRAME_MAPS.values() if frame_map.feedback in heard), CARRIAGE_MAP)
