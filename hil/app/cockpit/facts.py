"""What the page says of the rig, its controller and its models, from a deployment file or the record beside a log."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from hil.app.cockpit.panels import Panel, panels_of
from hil.app.scenario.model_facts import model_facts
from hil.bus.catalogue import Catalogue
from hil.nodes.controller.node import Task
from hil.nodes.frame_map import CARRIAGE_MAP, FRAME_MAPS, FrameMap


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
    return tuple(model_facts(model) for model in (task.model, *(offer.model for offer in offers)))


def wiring_of(heard: Collection[str]) -> FrameMap:
    """The drive whose feedback stands in a log of which no record says whose it is; a carriage where none does."""
    return next((wiring for wiring in FRAME_MAPS.values() if wiring.feedback in heard), CARRIAGE_MAP)
