"""The finer shape of a wave: with the named wave's size, place and phase, and what it leaves of contractions that begin
and end sharply.
"""

import numpy as np
from numpy.typing import NDArray

from models.assembly.effects import Active
from models.effects.effect import Signals
from models.effects.force import PeristalticWave
from models.effects.refinements import WaveHarmonics
from models.theta import Theta

Array = NDArray[np.float64]
SIZE_N, RATE_HZ, PER_M, PHASE = 0.03, 0.2, 25.0, 0.4
TIME = np.linspace(0.0, 1 / RATE_HZ, 4000, endpoint=False)
PLACE = 0.01 * np.sin(3 * TIME)
TURN = 2 * np.pi * (RATE_HZ * TIME - PER_M * PLACE) + PHASE


def coefficient(order: int) -> float:
    """Of cos(order q) in `max(0, sin q)`, over that of sin q."""
    return -4 / np.pi / (order**2 - 1) if order % 2 == 0 else 0.0


def wave(*orders: tuple[str, int]) -> Theta:
    values = {p.name: p.value for p in PeristalticWave.parameters()}
    values |= {
        "force_N": SIZE_N / 2,
        "frequency_Hz": RATE_HZ,
        "wavenumber_per_m": PER_M,
        "phase_rad": PHASE,
        "offset": 2 / np.pi,
    }
    values |= {f"{name}_cos": coefficient(k) for name, k in orders}
    return Theta(effects={"peristaltic_wave": values})


def finer(*orders: tuple[str, int]) -> Theta:
    values = {p.name: p.value for p in WaveHarmonics.parameters()} | {
        f"{name}_cos": coefficient(k) for name, k in orders
    }
    return Theta(effects={"wave_harmonics": values})


def left_of_half_a_sine(p: Theta) -> Array:
    """What the chosen effects leave of contractions `F max(0, sin q)` that travel, in units of F."""
    active = Active((PeristalticWave, WaveHarmonics), p)
    left = SIZE_N * np.maximum(0.0, np.sin(TURN)) - active.total("force", Signals(t=TIME, x=PLACE))
    return np.asarray(left / SIZE_N)


def test_with_it_a_wave_of_half_sines_leaves_only_what_lies_beyond_the_eighth_harmonic() -> None:
    model = wave(("second", 2), ("fourth", 4)) | finer(("sixth", 6), ("eighth", 8))
    beyond = sum(coefficient(k) / 2 * np.cos(k * TURN) for k in range(10, 4000, 2))
    assert np.allclose(left_of_half_a_sine(model), beyond, atol=1e-4)


def test_without_the_wave_it_does_nothing() -> None:
    absent = wave(("second", 2)) | {("peristaltic_wave", "force_N"): 0.0} | finer(("sixth", 6), ("eighth", 8))
    force = Active((PeristalticWave, WaveHarmonics), absent).total("force", Signals(t=TIME, x=PLACE))
    assert np.all(force == 0)
