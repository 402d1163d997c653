"""Models that close-loop wrote: one that leads from the begin on, one that takes over while a controller leads."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from controller.model.control_model import ControlModel
from controller.supervision.acceptance import Acceptance, judge
from controller.supervision.model_switch import Offer
from models.effects import Catalogue
from models.identification.finding import STAGES
from models.identification.model import read_model, read_report
from models.rigs.rig import Rig
from models.rigs.schema import Among, NamedTable, key
from models.theta import Theta


class ModelTable(NamedTable):
    """`[model]`: a model that close-loop wrote and that leads from the begin on."""

    where = "model"
    file: str = key("`model.toml` that `capsule close-loop` wrote, relative to this file")
    report: str = key("the `report.json` beside it")
    stage: Annotated[str, Among(STAGES)] = key("`nominal`, `calibrated` or `augmented`", "augmented")


class OfferTable(ModelTable):
    """`[offer]`: one that takes over later."""

    where = "offer"
    at_s: float = key("time from which the model is offered; it takes over at the next rest", 0.0, 0.0)


@dataclass(frozen=True)
class Offered:
    """An offer that passed the gate: the `values` of its model's parameters, and from when on."""

    values: Theta
    at_s: float

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Offered:
        return cls(Theta.read(document["values"]), float(document["at_s"]))

    def document(self) -> dict[str, Any]:
        return {"values": self.values.spelled(), "at_s": self.at_s}


def read_offer(table: OfferTable | None, folder: Path, rig: Rig, values: Theta) -> Offered | None:
    """The offered model, once past the gate against the one in use (a stage of the same file). Raises ValueError."""
    if table is None:
        return None
    model = read_model(folder / table.file, rig.kind, catalogue=Catalogue.of(rig))
    report = read_report(folder / table.report)
    used = next((stage for stage in STAGES if model.believed(stage) == values), "" if values else STAGES[0])
    verdict = judge(report, model, rig, stage=table.stage, current=used or math.nan)
    if not verdict.passed:
        raise ValueError(f"{folder / table.file}: offered model must pass the gate; got: {verdict.sentence}")
    return Offered(model.believed(table.stage), table.at_s)


def offer_of(offered: Offered | None, believed: Callable[[Theta], ControlModel]) -> Offer | None:
    """For a controller, whose models `believed` makes from values."""
    return None if offered is None else Offer(believed(offered.values), Acceptance(), offered.at_s)


def told(offered: Offered | None, taken_at_s: float) -> dict[str, Any]:
    """What a run's JSON object says of an offer, when it was taken in s of the reference's time."""
    if offered is None:
        return {}
    return {"offer": {"at_s": offered.at_s, "taken_at_s": None if math.isnan(taken_at_s) else taken_at_s}}


def offer_words(found: Mapping[str, Any]) -> str:
    offer = found.get("offer")
    if offer is None:
        return ""
    taken = offer["taken_at_s"]
    return f"offered model: {'not taken, there was no rest' if taken is None else f'taken at {taken:.3f} s'}"
