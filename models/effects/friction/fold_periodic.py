"""Resistance that varies periodically along the lumen (folds)."""

import math

import numpy as np

from models.effects.effect import Effect, Signals, Value, Values, by_name, number


class FoldPeriodic(Effect):
    """Level `1 + a (sin q + b sin 2q + c cos 2q + d sin 3q + e cos 3q)`, `q = 2 pi x/L + phi`, both ways."""

    id = "fold_periodic"
    words = "folds of the gut"
    summary = "resistance varies periodically along the lumen"
    source = "folds up to 8 mm deep (Gray)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    needs = ("places",)
    grid = by_name(wavelength_m=tuple(0.003 * 1.13**k for k in range(14)), phase_rad=(0.0, 1.5707963))
    probe = 0.05
    confounders = ("lumen_taper", "peristaltic_wave")
    separated_by = "reverse over the same place"
    refined_by = ("level_at_onset",)

    depth = number(0.0, "1", -0.9, 0.9)
    wavelength_m = number(0.008, "m", 0.002, 0.016)
    phase_rad = number(0.0, "rad", -7.0, 7.0, role="phase")
    second_sin = number(0.0, "1", -1.0, 1.0)
    second_cos = number(0.0, "1", -1.0, 1.0)
    third_sin = number(0.0, "1", -0.7, 0.7)
    third_cos = number(0.0, "1", -0.7, 0.7)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        turn = 2 * math.pi * s.x / p["wavelength_m"] + p["phase_rad"]
        wave = np.sin(turn) + p["second_sin"] * np.sin(2 * turn) + p["second_cos"] * np.cos(2 * turn)
        wave = wave + p["third_sin"] * np.sin(3 * turn) + p["third_cos"] * np.cos(3 * turn)
        return np.maximum(1 + p["depth"] * wave, 0.05)
