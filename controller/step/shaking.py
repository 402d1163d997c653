"""An inner mass's drive map and slow loop as sizes and numbers of the C controller."""

import math
from dataclasses import fields
from typing import Final

import numpy as np

from controller.signals import Array
from controller.vibro.controller import VibroController
from controller.vibro.gears import Gear
from controller.vibro.slow_loop import ProgressFilter
from controller.vibro.waveform import REST

_TUNING: Final = ("sample_s", "catch_up", "catch_up_stopped", "catch_up_s", "near_m", "blind_s", "feedback")
_NONE: Final = Gear((REST, REST), (1e-9, 2e-9), 1e-9)  # of a map that reaches no speed


def shaking(controller: VibroController) -> tuple[dict[str, int | str], dict[str, object]]:
    """Sizes and numbers of `controller`. Raises ValueError for a gear of several shapes."""
    gears, mpc = controller.drive.gears or (_NONE,), controller.mpc
    parts = max(len(wave.levels) for gear in gears for wave in gear.waveforms)
    low, high = controller.drive.reach()
    sizes: dict[str, int | str] = {
        "GEARS": len(gears),
        "PARTS": parts,
        "STAGES": mpc.horizon,
    }
    values: dict[str, object] = {
        "swing_m": math.inf,
        "stage_s": mpc.step_s,
        "reach_s": 0.0,
        **{name: float(getattr(controller.tuning, name)) for name in _TUNING},
        **{f.name: getattr(controller.filter, f.name) for f in fields(ProgressFilter)},
        "reach_low": low,
        "reach_high": high,
        "gear_first": np.cumsum([0, *(len(gear.waveforms) for gear in gears)]),
        "gear_home": [gear.home_m_s for gear in gears],
        "gear_period": [gear.waveforms[0].period_s for gear in gears],
        "gear_edge": np.concatenate([_edges(gear, parts) for gear in gears]),
        "wave_speed": np.concatenate([gear.speeds_m_s for gear in gears]),
        "wave_level": np.concatenate([_padded(w.levels, parts, 0.0) for gear in gears for w in gear.waveforms]),
        "mpc_free": mpc.free.ravel(),
        "mpc_forced": mpc.forced.ravel(),
        "mpc_hessian": mpc.hessian.ravel(),
        "mpc_inverse": mpc.inverse.ravel(),
        "mpc_scale": mpc.scale,
        "mpc_last": mpc.last,
    }
    return sizes, values


def _edges(gear: Gear, parts: int) -> Array:
    first = gear.waveforms[0]
    if any((w.period_s, w.edges) != (first.period_s, first.edges) for w in gear.waveforms):
        raise ValueError("gear must be one waveform at several strengths to be a table in C; got several")
    return _padded(first.edges, parts + 1, 1.0)


def _padded(values: tuple[float, ...], size: int, rest: float) -> Array:
    return np.array([*values, *[rest] * (size - len(values))])
