"""Resistance as a free curve over speed: what a named law of speed leaves of its own shape. Refines an effect, never named itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter

KNOTS_M_S = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)
_SOURCE = "no law: a curve through the speeds that the records contain"


def _knot(name: str) -> Parameter:
    return Parameter(name, 0.0, "1", -0.5, 0.5, _SOURCE, fit=True, spread=0.003)


@dataclass(frozen=True)
class LevelOverSpeed(Effect):
    """Level `1 + e(|v|) + d o(|v|)`, d the direction of motion: both curves straight in log speed between knots at 0.5, 1, 2, 4, 8 and
    16 mm/s, constant beyond. `even_k` and `odd_k` are their values at the knots."""

    id = "level_over_speed"
    summary = "resistance as a free curve over speed"
    source = _SOURCE
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    probe = 0.02
    look_alikes = ("stribeck", "viscous_drag", "directional_asymmetry")
    separated_by = "speeds over two decades"

    even_1: Parameter = _knot("even_1")
    even_2: Parameter = _knot("even_2")
    even_3: Parameter = _knot("even_3")
    even_4: Parameter = _knot("even_4")
    even_5: Parameter = _knot("even_5")
    even_6: Parameter = _knot("even_6")
    odd_1: Parameter = _knot("odd_1")
    odd_2: Parameter = _knot("odd_2")
    odd_3: Parameter = _knot("odd_3")
    odd_4: Parameter = _knot("odd_4")
    odd_5: Parameter = _knot("odd_5")
    odd_6: Parameter = _knot("odd_6")

    def level(self, s: Signals, p: Values, z: Values) -> Any:
        octaves = np.log2(np.maximum(np.abs(s.v), KNOTS_M_S[0]) / KNOTS_M_S[0])
        even, odd = p["even_1"], p["odd_1"]
        for k in range(1, len(KNOTS_M_S)):
            share = np.clip(octaves - (k - 1), 0.0, 1.0)
            even = even + (p[f"even_{k + 1}"] - p[f"even_{k}"]) * share
            odd = odd + (p[f"odd_{k + 1}"] - p[f"odd_{k}"]) * share
        return np.maximum(1 + even + s.direction * odd, 0.05)
