"""The design of a vibro rig in numbers: resonances, gears, energy by impact, margins of the slow loop."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
import scipy

from controller.design.tuning import OpenLoop, closed_loop
from controller.model.linear import Linear
from controller.vibro.cycles import Cycles, VibroModel, impact_of
from controller.vibro.drive_map import Alternative, SpeedMap, free_period, squares, wrong_models
from controller.vibro.gears import DriveMap
from controller.vibro.slow_loop import AveragedMpc, ProgressFilter, Tuning, transition

SPEEDS_M_S = tuple(sign * v for sign in (1, -1) for v in (2e-3, 5e-3, 10e-3, 20e-3))
_ABOUT = 0.2  # share of the speed for the slope of the map
_BOUNDLESS = 1e6  # m/s


@dataclass(frozen=True)
class Resonance:
    """Of the inner mass on its spring: `held_Hz` with the body fixed, `free_Hz` with it free, `damping` as a share of
    the critical one, and `contact_s`, the contact time at the front stop with the body free (NaN without that stop).
    """

    held_Hz: float
    free_Hz: float
    damping: float
    contact_s: float


@dataclass(frozen=True)
class SlowLoop:
    """The loop of filter and plan on the averaged motion at `speed_m_s`, updated once a cycle: `loop` with its margins,
    and the slope of the true mean speed over the commanded one with wrong models (`slope_low` to `slope_high`; the map
    has 1).
    """

    speed_m_s: float
    loop: OpenLoop
    slope_low: float
    slope_high: float

    @property
    def holds(self) -> bool:
        """Whether more command means more speed with all wrong models, and the loop bears the steepest."""
        return self.loop.stable() and self.slope_low > 0 and self.slope_high < self.loop.margins().gain


@dataclass(frozen=True)
class VibroStudy:
    """The result of `capsule design` for a vibro rig; `alternatives` by speed, `table`: speed map of square waves."""

    resonance: Resonance
    drive: DriveMap
    table: SpeedMap
    alternatives: dict[float, list[Alternative]]
    slow: tuple[SlowLoop, ...]
    delay_s: float

    @property
    def loops(self) -> tuple[OpenLoop, ...]:
        return tuple(one.loop for one in self.slow)


def vibro_study(model: VibroModel, drive: DriveMap, table: SpeedMap, delay_s: float = 0.015) -> VibroStudy:
    """Study `model` under its `drive` map at the speeds reached. Raises ValueError for a delay outside [0, 0.2] s."""
    if not 0 <= delay_s <= 0.2:
        raise ValueError(f"delay must lie in [0, 0.2] s; got {delay_s:g}")
    cycles, wrong = Cycles(model), [Cycles(m) for m in wrong_models(model)]
    reached = [v for v in SPEEDS_M_S if drive.nearest(v) is not None]
    found = {v: squares(cycles, table, v) for v in SPEEDS_M_S}
    for v in reached:
        wave = drive.choose(v).waveform
        gait = cycles.gait(wave)
        found[v].append(Alternative(wave, gait, impact_of(model, gait), "map"))
    slow = tuple(slow_loop(drive, wrong, v, delay_s) for v in reached)
    return VibroStudy(resonance(model), drive, table, found, slow, delay_s)


def resonance(model: VibroModel) -> Resonance:
    m, M, drive = model.drive.inner_mass_kg, model.surface.body_kg, model.drive
    held = 2 * math.pi / free_period(model)
    share = math.sqrt(1 + m / M)
    damping = float(model.values.get("spring_damping_N_s_per_m", drive.spring_damping_N_s_per_m))
    damping += float(model.values.get(("spring_damping", "damping_N_s_per_m"), 0.0))
    stiff = math.nan if drive.front is None else drive.front.stiffness_N_per_m
    contact = math.pi * math.sqrt(m * M / (m + M) / stiff) if stiff > 0 else math.nan
    return Resonance(held / (2 * math.pi), share * held / (2 * math.pi), damping / (2 * m * held), contact)


def slow_loop(drive: DriveMap, wrong: Sequence[Cycles], speed_m_s: float, delay_s: float) -> SlowLoop:
    """The averaged loop at `speed_m_s`, linear while neither reach nor catching up bounds it."""
    choice = drive.choose(speed_m_s)
    period, name = choice.waveform.period_s, f"slow loop, {1e3 * speed_m_s:g} mm/s"
    F, g = transition(period, drive.lag_s)
    plant = Linear("averaged", speed_m_s, speed_m_s, period, ("x", "s"), F[:2, :2], g[:2, None], F[:2, 2:])
    back = feedback(drive.lag_s, period, speed_m_s)
    loop = closed_loop(name, plant, control.series(plant.system(), back), delay_s)
    near = [drive.choose(f * speed_m_s, choice.gear).waveform for f in (1 - _ABOUT, 1 + _ABOUT)]
    slopes = [float(np.diff([c.gait(wave).speed_m_s for wave in near])[0]) / (2 * _ABOUT * speed_m_s) for c in wrong]
    return SlowLoop(speed_m_s, loop, min(slopes, default=1.0), max(slopes, default=1.0))


def feedback(lag_s: float, period_s: float, speed_m_s: float) -> control.StateSpace:
    """From progress to minus the commanded mean speed: the filter at its steady gain and the unbounded plan, once a
    period: `z = (I - K c)(F z_- + g u_-) + K y`, `u = k_z z + k_u u_-`. The readings of a period count as one of less
    variance.
    """
    F, g = transition(period_s, lag_s)
    f, h, kept = ProgressFilter(lag_s), period_s, np.ix_([0, 2], [0, 2])
    # the steady gain of the filter; the known s has none
    Q = (f.wander + f.wander_share * abs(speed_m_s)) ** 2 * np.array([[h**3 / 3, h * h / 2], [h * h / 2, h]])
    R = (f.reading_std_m**2 + f.ripple_m**2) * min(Tuning().sample_s / period_s, 1.0)
    P = scipy.linalg.solve_discrete_are(F[kept].T, np.array([[1.0], [0.0]]), Q, np.array([[R]]))
    K = np.array([P[0, 0], 0.0, P[1, 0]]) / (P[0, 0] + R)
    # the first command of the unbounded plan by the state and by the last command
    mpc = AveragedMpc(lag_s)
    ahead = (np.zeros(mpc.horizon), np.zeros(mpc.horizon), -_BOUNDLESS, _BOUNDLESS)
    k_z = np.array([mpc.plan(row, 0.0, *ahead)[0] for row in np.eye(3)])
    k_u = float(mpc.plan(np.zeros(3), 1.0, *ahead)[0])
    keep = np.eye(3)
    keep[:, 0] -= K
    A = np.zeros((4, 4))
    A[:3, :3], A[:3, 3] = keep @ F, keep @ g
    B = np.append(K, 0.0)[:, None]
    A[3] = k_z @ A[:3]
    A[3, 3] += k_u
    B[3] = k_z @ K
    return control.ss(A, B, -A[3:], -B[3:], period_s)
