"""What the page says of the rig, its controller and its models, from a deployment file or the record beside a log."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from controller.model.control_model import ControlModel
from hil.app.cockpit.panels import Panel, panels_of
from hil.app.quantities import DASH, quantity
from hil.bus.catalogue import Catalogue
from hil.nodes.controller.node import Task
from hil.nodes.frame_map import FRAME_MAPS, FrameMap
from models.effects import BY_ID


@dataclass(frozen=True)
class Facts:
    """`title` and `about` of the source, its drive, and its models in the order in which they may come into use; none
    where nothing says what they are.
    """

    title: str
    about: str
    wiring: FrameMap
    catalogue: Catalogue
    models: tuple[dict[str, Any], ...] = ()

    def document(self) -> dict[str, Any]:
        """As the page is told at its start."""
        return {
            "title": self.title,
            "about": self.about,
            "models": list(self.models),
            "panels": [panel.document() for panel in self.panels()],
        }

    def panels(self) -> tuple[Panel, ...]:
        """What is drawn."""
        return panels_of(self.wiring, self.catalogue)


def models_of(task: Task) -> tuple[dict[str, Any], ...]:
    """What the models of a task are made of, in the order in which they come into use."""
    offers = [offer for offer in (task.offer, *task.learned) if offer is not None]
    return tuple(_model(model) for model in (task.model, *(offer.model for offer in offers)))


def _model(model: ControlModel) -> dict[str, Any]:
    """Effects and parameters that differ from the rig file's, as words and numbers."""
    effects, rows = list[str](), list[list[str]]()
    for parameter, value in zip(model.symbols.parameters, model.values.tolist(), strict=True):
        effect, _, own = parameter.name.rpartition(".")
        if effect and effect not in effects:
            effects.append(effect)
        if effect or value != parameter.value:
            rows.append([own or parameter.name, quantity(value, parameter.unit), _nominal(effect, parameter)])
    summaries = {name: BY_ID[name].summary for name in effects if name in BY_ID}
    made = " + ".join(["base", *effects]) if effects else "base model"
    fitted = any(row for row in rows)
    return {"made": made, "kind": "learned" if fitted else "nominal values", "rows": rows, "effects": summaries}


def _nominal(effect: str, parameter: Any) -> str:
    """The rig file's number; an effect has none."""
    return DASH if effect else quantity(parameter.value, parameter.unit)


def wiring_of(heard: Collection[str]) -> FrameMap:
    """The drive whose feedback stands in a log of which no record says whose it is; a carriage where none does."""
    for wiring in FRAME_MAPS.values():
        if wiring.feedback in heard:
            return wiring
    return FRAME_MAPS["magnetic"]
