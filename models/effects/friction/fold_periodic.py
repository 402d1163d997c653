"""Resistance that varies periodically along the lumen (folds)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from models.effects.effect import Effect, Signals, Values
from models.parameter import Parameter


@dataclass(frozen=True)
class FoldPeriodic(Effect):
    """Level `1 + a (sin q + b sin 2q + c cos 2q + d sin 3q + e cos 3q)`, `q = 2 pi x/L + phi`: the same going and
    coming back.
    """

    id = "fold_periodic"
    summary = "resistance varies periodically along the lumen"
    source = "folds up to 8 mm deep (Gray)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    needs = ("places",)
    grid = MappingProxyType({"wavelength_m": tuple(0.003 * 1.13**k for k in range(14)), "phase_rad": (0.0, 1.5707963)})
    probe = 0.05
    confounders = ("lumen_taper", "peristaltic_wave")
    separated_by = "reverse over the same place"
    refined_by = ("level_at_onset",)

    depth: Parameter = Parameter("depth", 0.0, "1", -0.9, 0.9, "folds up to 8 mm deep (Gray)", fit=True)
    wavelength_m: Parameter = Parameter(
        "wavelength_m", 0.008, "m", 0.002, 0.016, "folds up to 8 mm deep (Gray)", fit=True
    )
    phase_rad: Parameter = Parameter(
        "phase_rad", 0.0, "rad", -7.0, 7.0, "folds up to 8 mm deep (Gray)", fit=True, role="phase"
    )
    second_sin: Parameter = Parameter("second_sin", 0.0, "1", -1.0, 1.0, "folds up to 8 mm deep (Gray)", fit=True)
    second_cos: Parameter = Parameter("second_cos", 0.0, "1", -1.0, 1.0, "folds up to 8 mm deep (Gray)", fit=True)

    third_sin: Parameter = Parameter("third_sin", 0.0, "1", -0.7, 0.7, "folds up to 8 mm deep (Gray)", fit=True)
    third_cos: Parameter = Parameter("third_cos", 0.0, "1", -0.7, 0.7, "folds up to 8 mm deep (Gray)", fit=True)

    def level(self, s: Signals, p: Values, z: Values) -> Any:
        turn = 2 * math.pi * s.x / p["wavelength_m"] + p["phase_rad"]
        wave = np.sin(turn) + p["second_sin"] * np.sin(2 * turn) + p["second_cos"] * np.cos(2 * turn)
        wave = wave + p["third_sin"] * np.sin(3 * turn) + p["third_cos"] * np.cos(3 * turn)
        return np.maximum(1 + p["depth"] * wave, 0.05)
