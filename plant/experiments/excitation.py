"""Drive profiles: dwells and runs at several speeds, wandering sums of sines, pulse-width modulation in trains."""

import numpy as np

from plant.tables import Floats

RUN_SPEEDS_M_S = (0.5e-3, 1e-3, 2e-3, 4e-3, 7e-3, 10e-3, 14e-3)  # of a pull programme
_RAMP_S = 0.02  # time in which a stage comes to speed


def piecewise_runs(segments: list[tuple[float, float]], dt: float, ramp_s: float = _RAMP_S) -> Floats:
    """Positions in m, one a step, of runs (m/s, s) one after the other; speed ramps take `ramp_s`."""
    speed = np.concatenate([np.full(max(1, round(duration / dt)), v) for v, duration in segments])
    width = max(1, round(ramp_s / dt))
    sums = np.cumsum(np.concatenate([np.zeros(width), speed]))
    smooth = (sums[width:] - sums[:-width]) / width
    return np.concatenate([[0.0], np.cumsum(smooth) * dt])


def random_runs(rng: np.random.Generator, duration_s: float, dt: float) -> Floats:
    """A pull programme: out and back at `RUN_SPEEDS_M_S` in random order, each run 1.5 to 6 s and about 12 mm, rests of
    0.05 to 1.5 s between. It stops with the pair that reaches `duration_s`, so it may last a few seconds longer.
    """
    segments, total = [(0.0, 0.5)], 0.5
    while total < duration_s:
        for speed in rng.permutation(RUN_SPEEDS_M_S):
            run = float(np.clip(12e-3 / speed, 1.5, 6.0))
            rests = rng.choice([0.05, 0.5, 1.5], 2)
            segments += [(speed, run), (0.0, float(rests[0])), (-speed, run), (0.0, float(rests[1]))]
            total += 2 * run + float(rests.sum())
            if total >= duration_s:
                break
    return piecewise_runs(segments, dt)


def random_wander(rng: np.random.Generator, duration_s: float, dt: float) -> Floats:
    """A carriage path in m from zero, further forward than back: seven sines of 0.03 to 0.9 Hz, the slow ones wide,
    faded in over half a second; up to some 30 mm/s.
    """
    t = np.arange(round(duration_s / dt) + 1) * dt
    x = np.zeros_like(t)
    for frequency in np.geomspace(0.03, 0.9, 7) * rng.uniform(0.8, 1.25, 7):
        speed = rng.uniform(4e-3, 9e-3)
        phase = rng.uniform(0, 2 * np.pi)
        x += speed / (2 * np.pi * frequency) * (np.sin(2 * np.pi * frequency * t + phase) - np.sin(phase))
    fade = np.clip(t / 0.5, 0.0, 1.0)
    path = x * fade * fade * (3 - 2 * fade)
    return np.asarray(path if path.max() >= -path.min() else -path)


def pulse_width(period_s: float, duty: float, duration_s: float, dt: float) -> Floats:
    """Share of each step in which a PWM drive is on, first for `duty` of each period, exact for edges inside a step;
    one value more than steps. Raises `ValueError` for a period that is not positive or a duty outside [0, 1].
    """
    if not period_s > 0 or not 0 <= duty <= 1:
        raise ValueError(f"period_s must be positive and duty lie in [0, 1]; got {period_s:g} and {duty:g}")
    cycles = np.arange(round(duration_s / dt) + 2) * (dt / period_s)
    on_time = np.floor(cycles) * duty + np.minimum(cycles - np.floor(cycles), duty)
    return np.asarray(np.diff(on_time) * (period_s / dt))
