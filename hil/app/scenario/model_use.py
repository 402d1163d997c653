"""Which model a run uses, what it is made of, and what the monitor says of it."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from controller.drives import DRIVES
from controller.model.control_model import ControlModel
from controller.monitor.monitor import Health
from hil.app.console import note
from models.effects import CATALOGUE, Catalogue
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.theta import Theta
from models.words.quantities import DASH, quantity


def values_of(model: Path | None, stage: str | None, kind: str, known: Catalogue = CATALOGUE) -> tuple[Theta, str]:
    """Parameters that a rig of `kind` is believed to have, and the name of their stage. Raises ValueError."""
    if stage is not None:
        check_word(stage, "--stage", STAGES)
    if model is None:
        if stage not in (None, "nominal"):
            raise ValueError(f"--stage must stand with --model unless it is nominal; got {stage!r} alone")
        return Theta(), "nominal"
    stage = stage or "augmented"
    learned = read_model(model, *(DRIVES[kind].models or (kind,)), catalogue=known)
    if stage in learned.cautions:
        note(f"{model}: {learned.cautions[stage]}")
    return learned.believed(stage), stage


def model_facts(model: ControlModel) -> dict[str, Any]:
    """Effects and parameters that differ from the rig file's, as words and numbers."""
    effects, rows = list(model.theta.effects), list[list[str]]()
    for p, value in zip(model.symbols.parameters, model.values.tolist(), strict=True):
        if p.effect or value != p.value:  # the rig file has no number of an effect
            rows.append([p.name, quantity(value, p.unit), DASH if p.effect else quantity(p.value, p.unit)])
    summaries = {effect.id: effect.summary for effect in model.symbols.effects}
    made = " + ".join(["base", *effects]) if effects else "base model"
    return {"made": made, "kind": "learned" if rows else "nominal values", "rows": rows, "effects": summaries}


def health_of(health: Health, origin_s: float = 0.0) -> dict[str, Any]:
    """The object `monitor` of a run's JSON object; times in s of the reference's time, which began at `origin_s`."""
    since = health.since_s - origin_s if math.isfinite(origin_s) else 0.0
    return {
        "state": health.state,
        "since_s": max(since, 0.0),
        "alarms": health.alarms,
        "change": health.change or None,
        "evidence": health.evidence,
    }


def health_words(found: Mapping[str, Any]) -> str:
    monitor = found["monitor"]
    state, since = monitor["state"], monitor["since_s"]
    if state == "not watched":
        return "model: not watched, as the controller uses none"
    if state != "broken":
        return f"model {'holds' if state == 'holds' else 'doubtful'} ({100 * monitor['evidence']:.0f} % of an alarm)"
    return f"model broken since {since:.1f} s, a {monitor['change']} change"
