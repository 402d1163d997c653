"""What a control model is made of, in words and numbers."""

from typing import Any

from controller.model.control_model import ControlModel
from hil.report.quantities import DASH, quantity


def model_facts(model: ControlModel) -> dict[str, Any]:
    """Effects and parameters that differ from the rig file's, as words and numbers."""
    effects, rows = list(model.theta.effects), list[list[str]]()
    for p, value in zip(model.symbols.parameters, model.values.tolist(), strict=True):
        if p.effect or value != p.value:  # the rig file has no number of an effect
            rows.append([p.name, quantity(value, p.unit), DASH if p.effect else quantity(p.value, p.unit)])
    summaries = {effect.id: effect.summary for effect in model.symbols.effects}
    made = " + ".join(["base", *effects]) if effects else "base model"
    return {"made": made, "kind": "learned" if rows else "nominal values", "rows": rows, "effects": summaries}
