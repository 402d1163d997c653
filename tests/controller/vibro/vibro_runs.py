"""The vibro controller on the plant, stepped through a session, and how its mean speed is judged."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controller.signals import Estimate
from controller.vibro.controller import VibroController
from controller.vibro.cycles import VibroModel
from models.drives.vibro import Stop, Vibro
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from models.surfaces.surface import Plate
from models.theta import Theta
from plant import layout as at
from plant.drives import TrueVibro
from plant.rig import TruePlate, Truth
from plant.session import Instruments, Session

Array = NDArray[np.float64]
GUT_DRIVE = TrueVibro(4e-3, 62.0, 0.0156, 0.5, True, 6e-3, 2e4, 6e-3, 2e4)
"""A 4 g magnet in the 4 g capsule on a 62 N/m spring between stops 6 mm away, pushed by up to 0.5 N: fits the 33 mm
capsule.
"""
PLATE_DRIVE = TrueVibro(0.074, 256.23, 0.0, 1.25, True)
PLATE_BODY_KG, PLATE_MU = 0.193, 0.29
_HANN_S = 0.4


def gut_model() -> VibroModel:
    """What the controller believes of the rig in the gut."""
    return believed(GUT_DRIVE, Wall.around(Capsule(), Tissue()))


def plate_model(values: Theta | None = None) -> VibroModel:
    """What the controller believes of the capsubot on a plate."""
    return believed(PLATE_DRIVE, Plate(PLATE_BODY_KG, PLATE_MU), values)


def believed(drive: TrueVibro, surface: Wall | Plate, values: Theta | None = None) -> VibroModel:
    """The control model with the same numbers as a plant's drive."""
    front = Stop(drive.front_gap_m, drive.front_stiffness_N_per_m) if drive.front_stiffness_N_per_m else None
    rear = Stop(drive.rear_gap_m, drive.rear_stiffness_N_per_m) if drive.rear_stiffness_N_per_m else None
    numbers = (drive.inner_mass_kg, drive.spring_stiffness_N_per_m, drive.spring_damping_N_s_per_m, drive.force_N)
    return VibroModel.of(surface, Vibro(*numbers, drive.reaction_on_body, front, rear), values or Theta())


def gut_plant(
    spring: float = 1.0, force: float = 1.0, hoop: float = 1.0, mu: float = 1.0, base: TrueVibro = GUT_DRIVE
) -> Truth:
    """The true rig in the gut, its parameters off by these factors."""
    drive = replace(base, spring_stiffness_N_per_m=spring * base.spring_stiffness_N_per_m, force_N=force * base.force_N)
    return Truth(drive, Capsule(), Tissue(friction_coefficient=mu * Tissue().friction_coefficient), hoop_factor=hoop)


def plate_plant(
    spring: float = 1.0, force: float = 1.0, mu: float = 1.0, hidden: dict[str, dict[str, float]] | None = None
) -> Truth:
    """The true capsubot on its plate, its parameters off by these factors."""
    base = PLATE_DRIVE
    drive = replace(base, spring_stiffness_N_per_m=spring * base.spring_stiffness_N_per_m, force_N=force * base.force_N)
    return Truth(drive, Capsule(mass_kg=PLATE_BODY_KG), surface=TruePlate(mu * PLATE_MU), hidden=hidden or {})


@dataclass(frozen=True)
class Steady:
    """A reference of one mean speed from 0 on."""

    speed_m_s: float

    def position(self, t: Array) -> Array:
        """Position in m."""
        with np.errstate(all="ignore"):
            return self.speed_m_s * np.asarray(t, dtype=float)

    def speed(self, t: Array) -> Array:
        """Speed in m/s."""
        return np.full(np.shape(t), self.speed_m_s)


@dataclass(frozen=True)
class Drive:
    """A run: times in s and true positions in m of the body, the commands and how long each tick took in s."""

    t: Array
    x: Array
    commands: Array
    tick_s: Array

    def mean_speeds(self, window_s: float = 1.0) -> tuple[Array, Array]:
        """Starts of windows of `window_s` and the mean speed in each: differences of the path smoothed over `_HANN_S`,
        which takes the body's swing within a cycle out (it is as large as what it advances).
        """
        h = float(self.t[1] - self.t[0])
        weight = np.hanning(round(_HANN_S / h) + 2)[1:-1]
        smooth = np.convolve(self.x, weight / weight.sum(), mode="valid")
        times = self.t[: smooth.size] + 0.5 * (weight.size - 1) * h
        starts = np.arange(times[0], times[-1] - window_s, 0.02)
        return starts, (np.interp(starts + window_s, times, smooth) - np.interp(starts, times, smooth)) / window_s

    def settled_s(self, speed_m_s: float, share: float = 0.1, window_s: float = 1.0) -> float:
        """When the mean speed over `window_s` has come within `share` of `speed_m_s` for good: start of the first such
        window.
        """
        starts, speeds = self.mean_speeds(window_s)
        off = np.abs(speeds / speed_m_s - 1) > share
        if not off.any():
            return 0.0
        last = int(np.flatnonzero(off)[-1])
        return math.inf if last + 1 >= off.size else float(starts[last + 1])

    def mean_speed(self, from_s: float) -> float:
        """Mean speed in m/s from `from_s` to the end."""
        starts, speeds = self.mean_speeds(float(self.t[-1]) - from_s - 1.2 * _HANN_S)
        return float(np.interp(from_s, starts, speeds))


def drive_plant(
    controller: VibroController,
    rig: Truth,
    reference: object,
    seconds: float,
    seed: int = 0,
    instruments: Instruments | None = None,
) -> Drive:
    """The controller on the plant; it sees stamped, late, noisy positions alone."""
    tick = controller.tuning.tick_s
    session = Session(rig, instruments, seed)
    estimate = Estimate(0.0, np.zeros(1), np.zeros(1))
    controller.reset(0.0, estimate, 0.0)
    commands, took = [], []
    for k in range(round(seconds / tick)):
        action = controller.act(k * tick, estimate, reference)  # type: ignore[arg-type]
        commands.append(action.command)
        took.append(action.timings["total"])
        for reading in session.advance(action.command, (k + 1) * tick):
            estimate = Estimate(reading.stamp_s, np.array([reading.value]), np.array([0.5e-3]))
    rows = np.concatenate(session.rows)
    return Drive(rows[:, at.O_T], rows[:, at.O_X], np.array(commands), np.array(took))
