"""Models that close-loop wrote: the one that leads first, the one on offer, and the health that the monitor reports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np

from controller.drives import DRIVES
from controller.model.control_model import ControlModel
from controller.monitor import Health
from controller.reference import STEP_S, Trajectory
from controller.supervision.acceptance import Acceptance, judge
from controller.supervision.model_switch import Offer
from hil.app.console import note
from hil.report.words import beyond_words
from models.effects import CATALOGUE, Catalogue
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.model import Model, read_model, read_report
from models.identification.validity import Ranges, beyond, motion_ranges
from models.rigs.rig import Rig
from models.rigs.schema import Among, NamedTable, key
from models.theta import Theta
from models.words.quantities import DASH, quantity
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
CHOSEN: Final = "chosen"  # The stage of a run whose model is chosen for it


class ModelTable(NamedTable):
    """`[model]`: a model that close-loop wrote and that leads from the start."""

    where = "model"
    file: str = key("`model.toml` that `capsule close-loop` wrote, relative to this file")
    report: str = key("the `report.json` beside it")
    stage: Annotated[str, Among((*STAGES, CHOSEN))] = key(
        "`nominal`, `calibrated`, `augmented`, or `chosen`: what is expected to track best, where the model carries a"
        " choice, else `augmented`",
        CHOSEN,
    )


class OfferTable(ModelTable):
    """`[offer]`: a model that takes over later."""

    where = "offer"
    stage: Annotated[str, Among(STAGES)] = key("`nominal`, `calibrated` or `augmented`", "augmented")
    at_s: float = key("time from which the model is offered; it takes over at the next rest", 0.0, 0.0)


@dataclass(frozen=True)
class Offered:
    """An offer that passed the acceptance test: the parameter `values` of its model, and its time."""

    values: Theta
    at_s: float

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Offered:
        return cls(Theta.read(document["values"]), float(document["at_s"]))

    def document(self) -> dict[str, Any]:
        return {"values": self.values.spelled(), "at_s": self.at_s}


def read_offer(table: OfferTable | None, folder: Path, rig: Rig, values: Theta) -> Offered | None:
    """The offered model, which must pass the acceptance test against the one in use. Raises ValueError."""
    if table is None:
        return None
    model = read_model(folder / table.file, rig.kind, catalogue=Catalogue.of(rig))
    report = read_report(folder / table.report)
    used = next((stage for stage in STAGES if model.believed(stage) == values), "" if values else STAGES[0])
    verdict = judge(report, model, rig, stage=table.stage, current=used or math.nan)
    if not verdict.passed:
        raise ValueError(f"{folder / table.file}: offered model must pass the acceptance test; got: {verdict.sentence}")
    return Offered(model.believed(table.stage), table.at_s)


def offer_of(offered: Offered | None, believed: Callable[[Theta], ControlModel]) -> Offer | None:
    return None if offered is None else Offer(believed(offered.values), Acceptance(), offered.at_s)


def offer_document(offered: Offered | None, taken_at_s: float) -> dict[str, Any]:
    """The key `offer` of a run's JSON object; `taken_at_s` is in s of the reference, nan where it was not taken."""
    if offered is None:
        return {}
    return {"offer": {"at_s": offered.at_s, "taken_at_s": None if math.isnan(taken_at_s) else taken_at_s}}


def offer_words(found: Mapping[str, Any]) -> str:
    offer = found.get("offer")
    return "" if offer is None else TEXT("offer.not_taken" if offer["taken_at_s"] is None else "offer.taken", **offer)


def model_for(path: Path, kind: str, known: Catalogue = CATALOGUE) -> Model:
    return read_model(path, *(DRIVES[kind].models or (kind,)), catalogue=known)


def values_of(path: Path | None, learned: Model | None, stage: str | None) -> tuple[Theta, str]:
    """The believed parameters by the model `learned` from the file `path`, if any, and the name of their stage, or of a
    model that the records leave possible. Raises ValueError.
    """
    if stage is not None:
        check_word(stage, "--stage", (*STAGES, *(learned.possible if learned else ()), CHOSEN))
    if learned is None:
        if stage not in (None, "nominal"):
            raise ValueError(f"--stage must stand with --model unless it is nominal; got {stage!r} alone")
        return Theta(), "nominal"
    stage = stage or "augmented"
    if stage in learned.cautions:
        note(f"{path}: {learned.cautions[stage]}")
    if stage in learned.barred:
        note(f"{path}: {TEXT('barred', stage=stage, why=learned.barred[stage])}")
    return learned.believed(stage), stage


def motion_beyond(covered: Ranges, reference: Trajectory, duration_s: float) -> dict[str, Any]:
    """The key `beyond_records`: where a `reference` leaves what the records of a model `covered`; it is noted."""
    times = np.linspace(0.0, duration_s, 1 + max(round(duration_s / STEP_S), 1))
    found = beyond(covered, motion_ranges(times, reference.position(times), reference.speed(times)))
    note_beyond(found)
    return found


def note_beyond(found: Mapping[str, Any]) -> None:
    if found:
        note(beyond_words(found))


def model_facts(model: ControlModel) -> dict[str, Any]:
    """Effects and parameters that differ from the rig file, as words and numbers."""
    effects, rows = list(model.theta.effects), list[list[str]]()
    for p, value in zip(model.symbols.parameters, model.values.tolist(), strict=True):
        if p.effect or value != p.value:  # the rig file has no number of an effect
            rows.append([p.name, quantity(value, p.unit), DASH if p.effect else quantity(p.value, p.unit)])
    summaries = {effect.id: effect.summary for effect in model.symbols.effects}
    made = " + ".join(["base", *effects]) if effects else "base model"
    return {"made": made, "kind": "learned" if rows else "nominal values", "rows": rows, "effects": summaries}


def health_of(health: Health, origin_s: float = 0.0) -> dict[str, Any]:
    """The key `monitor` of a run's JSON object; times in s of the reference, which began at `origin_s`."""
    since = health.since_s - origin_s if math.isfinite(origin_s) else 0.0
    return {
        "state": health.state,
        "since_s": max(since, 0.0),
        "alarms": health.alarms,
        "change": health.change or None,
        "evidence": health.evidence,
    }


def chosen_words(found: Mapping[str, Any]) -> str:
    chosen = found.get("chosen")
    return "" if chosen is None else TEXT("chosen", **chosen)


def health_words(found: Mapping[str, Any]) -> str:
    monitor = found["monitor"]
    return TEXT(f"health.{monitor['state'].replace(' ', '_')}", **monitor)
