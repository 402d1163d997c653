"""The control model with friction as sharp as it is: for estimating and inverting, which need no derivatives of it."""

from __future__ import annotations

from controller.prediction import ControlModel, control_model

SHARP_M_S = 1e-6


def sharpened(model: ControlModel, smoothing: float = SHARP_M_S, tick_s: float | None = None) -> ControlModel:
    """`model` with friction rounded over `smoothing` in m/s instead of its own.

    Rounded over 50 um/s, friction at 1 mm/s is 5 % too low, and the path runs 0.5 mm ahead of the exact stick and slip; over 1 um/s
    by 0.04 mm.
    """
    values = dict(zip((p.name for p in model.symbols.parameters), model.values.tolist(), strict=True))
    return control_model(model.rig, values, tick_s or model.tick_s, min(smoothing, model.smoothing), model.command_name)
