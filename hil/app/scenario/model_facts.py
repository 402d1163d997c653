"""What a control model is made of, in words and numbers."""

from __future__ import annotations

from typing import Any

from controller.model.control_model import ControlModel
from hil.app.quantities import DASH, quantity
from models.effects import BY_ID


def model_facts(model: ControlModel) -> dict[str, Any]:
    """Effects and parameters that differ from the rig file's, as words and numbers."""
    effects, rows = list[str](), list[list[str]]()
    for parameter, value in zip(model.symbols.parameters, model.values.tolist(), strict=True):
        effect = parameter.effect
        if effect and effect not in effects:
            effects.append(effect)
        if effect or value != parameter.value:
            rows.append([parameter.name, quantity(value, parameter.unit), _nominal(effect, parameter)])
    summaries = {name: BY_ID[name].summary for name in effects if name in BY_ID}
    made = " + ".join(["base", *effects]) if effects else "base model"
    fitted = any(row for row in rows)
    return {"made": made, "kind": "learned" if fitted else "nominal values", "rows": rows, "effects": summaries}


def _nominal(effect: str, parameter: Any) -> str:
    """The rig file's number; an effect has none."""
    return DASH if effect else quantity(parameter.value, parameter.unit)
