"""The four-phase internal-force profile: the inner mass accelerates hard, brakes softly, returns softly and brakes
hard.
"""

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from controller.vibro.cycles import SETTLE_S, Cycles, Gait
from controller.vibro.drive_map import free_period
from controller.vibro.waveform import Waveform

Array = NDArray[np.float64]
_PARTS, _SUBSTEPS = 64, 8
_STIFF, _DAMPED = 600.0, 30.0  # 1/s^2, 1/s, how the inner mass is kept on its path
STROKES_M = tuple(np.geomspace(0.4e-3, 8e-3, 14).tolist())
SHARES = (0.15, 0.25, 0.35)
RATIOS = (0.6, 0.8, 0.95, 1.05, 1.3, 1.7)
MIDDLES = (0.15, 0.3, 0.5)


def profile(turn: float, share: float, period_s: float, stroke_m: float, direction: int) -> tuple[float, float, float]:
    """Place, speed and acceleration of the inner mass against the body at `turn` of a cycle, SI, about the middle of
    its stroke.

    Phases of the lengths s/2, (1 - s)/2, (1 - s)/2, s/2 with s = `share`: accelerations -a, +b, +b, -a with a s = b (1
    - s) for a body driven forward (`direction` 1); `stroke_m` = a s T^2/8 (end to end of the swing). Structure as the
    published four-step profiles of internal-force capsule robots (Huda and Yu's utroque).
    """
    hard = 8 * stroke_m / (share * period_s**2)
    soft = hard * share / (1 - share)
    top = 0.5 * share * period_s * hard
    t, t1 = (turn % 1.0) * period_s, 0.5 * share * period_s
    if t < t1:
        out = (-0.5 * hard * t * t, -hard * t, -hard)
    elif t < period_s - t1:
        s = t - t1
        out = (-0.5 * hard * t1 * t1 - top * s + 0.5 * soft * s * s, -top + soft * s, soft)
    else:
        s = period_s - t
        out = (-0.5 * hard * s * s, hard * s, -hard)
    return direction * (out[0]), direction * out[1], direction * out[2]


def four_phase(
    cycles: Cycles, period_s: float, share: float, stroke_m: float, direction: int, middle: float = 0.5
) -> Waveform:
    """The levels with which the model's inner mass follows the profile, as far as a coil that pushes one way only can:
    `F = m (r'' + a + stiff e + damped e') + S` within [0, F], about the place where the level `middle` would hold it;
    recorded once they repeat. The body's acceleration a is solved along with F for a friction as it just was.
    """
    model, sub = cycles.model, _SUBSTEPS
    m, k = model.drive.inner_mass_kg, (2 * math.pi / free_period(model)) ** 2 * model.drive.inner_mass_kg
    damping = float(model.values.get("spring_damping_N_s_per_m", model.drive.spring_damping_N_s_per_m))
    damping += float(model.values.get(("spring_damping", "damping_N_s_per_m"), 0.0))
    full, ratio = abs(model.force_N), m / model.surface.body_kg
    held, friction = middle * full / k, 0.0
    names = cycles.states
    at = [names.index(name) for name in (("vibro", "stretch_m"), ("vibro", "rate_m_s"), "a")]
    state, h = cycles.rest(), period_s / (_PARTS * sub)
    levels = np.zeros(_PARTS)
    for _ in range(max(math.ceil(SETTLE_S / period_s), 3)):
        for i in range(_PARTS):
            r, w = state[at[:2]]
            place, speed, acceleration = profile((i + 0.5) / _PARTS, share, period_s, stroke_m, direction)
            spring = k * r + damping * w
            wanted = m * (acceleration + _STIFF * (held + place - r) + _DAMPED * (speed - w))
            force = (wanted + spring + ratio * (spring + friction)) / (1 + ratio)
            levels[i] = min(max(force / full, 0.0), 1.0)
            for _step in range(sub):
                cycles.step(state, float(levels[i]), h)
            friction = model.surface.body_kg * state[at[2]] + full * levels[i] - spring
    return Waveform.even(period_s, levels)


def best_four_phase(cycles: Cycles, speeds_m_s: tuple[float, ...]) -> dict[float, tuple[Waveform, Gait] | None]:
    """For each mean speed the cheapest four-phase drive that comes within 10 % of it, replayed as a waveform; None
    without one.
    """
    found: dict[float, tuple[Waveform, Gait] | None] = dict.fromkeys(speeds_m_s)
    directions = sorted({int(math.copysign(1, v)) for v in speeds_m_s})
    for ratio, share, stroke, middle, direction in product(RATIOS, SHARES, STROKES_M, MIDDLES, directions):
        wave = four_phase(cycles, ratio * free_period(cycles.model), share, stroke, direction, middle)
        gait = cycles.gait(wave)
        for v in speeds_m_s:
            held = found[v]
            near = abs(gait.speed_m_s / v - 1) < 0.1
            if near and (held is None or gait.energy_J_per_m < held[1].energy_J_per_m):
                found[v] = (wave, gait)
    return found
