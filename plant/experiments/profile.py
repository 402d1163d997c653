"""What a scenario commands: the profiles that its file can name, each with one drive value per step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from models.files.csv_reader import read_table
from plant.tables import Floats

RUN_SPEEDS_M_S = (0.5e-3, 1e-3, 2e-3, 4e-3, 7e-3, 10e-3, 14e-3)  # of a pull programme
_RAMP_S = 0.02  # of a change of speed
LONGEST_S: Final = 86400.0  # a day, of a run
FASTEST_M_S: Final = 0.5  # above the range over which the resistance law was integrated


def piecewise_runs(segments: list[tuple[float, float]], dt: float, ramp_s: float = _RAMP_S) -> Floats:
    """Positions in m, one per step, of runs (m/s, s) in a row; a change of speed takes `ramp_s`."""
    speed = np.concatenate([np.full(max(1, round(duration / dt)), v) for v, duration in segments])
    width = max(1, round(ramp_s / dt))
    sums = np.cumsum(np.concatenate([np.zeros(width), speed]))
    smooth = (sums[width:] - sums[:-width]) / width
    return np.concatenate([[0.0], np.cumsum(smooth) * dt])


def pulse_width(period_s: float, duty: float, duration_s: float, dt: float) -> Floats:
    """Share of each step in which a PWM drive is on, first for `duty` of each period, exact for edges inside a step;
    one value more than steps. Raises `ValueError` for a period not above 0 or a duty outside [0, 1].
    """
    if not period_s > 0 or not 0 <= duty <= 1:
        raise ValueError(f"period_s must be positive and duty lie in [0, 1]; got {period_s:g} and {duty:g}")
    cycles = np.arange(round(duration_s / dt) + 2) * (dt / period_s)
    on_time = np.floor(cycles) * duty + np.minimum(cycles - np.floor(cycles), duty)
    return np.asarray(np.diff(on_time) * (period_s / dt))


def _check_speeds(key: str, *speeds: float) -> None:
    wrong = [v for v in speeds if not abs(v) <= FASTEST_M_S]
    if wrong:
        raise ValueError(f"profile.{key} must lie within {FASTEST_M_S:g} m/s either way; got {wrong[0]:g}")


class Profile(Protocol):
    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        """A value at each step of `dt`, both ends included: m, V, N, or shares of a step with PWM on."""
        ...


class WholeRuns:
    """Out and back at `RUN_SPEEDS_M_S` in random order, each run 1.5 to 6 s and about 12 mm, with rests of 0.05 to 1.5
    s. The profile ends with the pair of runs that reaches the duration, so it may last a few seconds longer.
    """

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
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


@dataclass(frozen=True)
class RandomRuns(WholeRuns):
    """The same, cut at the duration."""

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        return super().values(duration_s, dt, rng)[: round(duration_s / dt) + 1]


@dataclass(frozen=True)
class Wander:
    """A carriage path in m from zero: seven sines of 0.03 to 0.9 Hz, faded in over half a second, up to 30 mm/s."""

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        t = np.arange(round(duration_s / dt) + 1) * dt
        x = np.zeros_like(t)
        for frequency in np.geomspace(0.03, 0.9, 7) * rng.uniform(0.8, 1.25, 7):
            speed = rng.uniform(4e-3, 9e-3)
            phase = rng.uniform(0, 2 * np.pi)
            x += speed / (2 * np.pi * frequency) * (np.sin(2 * np.pi * frequency * t + phase) - np.sin(phase))
        fade = np.clip(t / 0.5, 0.0, 1.0)
        path = x * fade * fade * (3 - 2 * fade)
        return np.asarray(path if path.max() >= -path.min() else -path)


@dataclass(frozen=True)
class Runs:
    """Runs at `speeds_m_s` for `durations_s`, in a row, then rest."""

    speeds_m_s: tuple[float, ...]
    durations_s: tuple[float, ...]

    def __post_init__(self) -> None:
        wrong = [d for d in self.durations_s if not 0 < d <= LONGEST_S]
        if wrong:
            raise ValueError(f"profile.durations_s must be more than 0 and at most {LONGEST_S:g} s; got {wrong[0]:g}")
        _check_speeds("speeds_m_s", *self.speeds_m_s)
        many, got = len(self.speeds_m_s), len(self.durations_s)
        if many != got:
            raise ValueError(f"profile.durations_s must be as many as speeds_m_s, {many}; got {got}")

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        segments = [*zip(self.speeds_m_s, self.durations_s, strict=True), (0.0, duration_s)]
        return piecewise_runs(segments, dt)[: round(duration_s / dt) + 1]


@dataclass(frozen=True)
class ConstantSpeed:
    """`x = v t` from the start."""

    speed_m_s: float

    def __post_init__(self) -> None:
        _check_speeds("speed_m_s", self.speed_m_s)

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        return np.asarray(self.speed_m_s * dt * np.arange(round(duration_s / dt) + 1), dtype=np.float64)


@dataclass(frozen=True)
class SineProfile:
    """`offset + amplitude sin(2 pi f t)`, the amplitude in one of the units."""

    frequency_Hz: float
    amplitude_m: float = 0.0
    amplitude_V: float = 0.0
    amplitude_N: float = 0.0
    amplitude_rad: float = 0.0
    amplitude_N_m: float = 0.0
    offset: float = 0.0

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        amplitudes = {name: value for name, value in vars(self).items() if name.startswith("amplitude")}
        given = [a for a in amplitudes.values() if a != 0.0]
        if len(given) != 1:
            raise ValueError(f"sine must have one of {', '.join(amplitudes)}; got {len(given)} of them")
        t = dt * np.arange(round(duration_s / dt) + 1)
        return np.asarray(self.offset + given[0] * np.sin(2 * np.pi * self.frequency_Hz * t))


@dataclass(frozen=True)
class Pwm:
    """Pulse-width modulation: on first, for `duty` of each period; `amplitude_V` for a coil, else the drive's force."""

    period_s: float
    duty: float
    amplitude_V: float = 1.0

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        return self.amplitude_V * pulse_width(self.period_s, self.duty, duration_s, dt)


@dataclass(frozen=True)
class RandomPulses(Pwm):
    """Trains of 1 to 3 s of 0.6 to 1.6 times `period_s`, duties 0.15 to 0.85; a quarter are rests of 0.4 s."""

    duty: float = 0.5

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        parts: list[Floats] = []
        while sum(part.size for part in parts) * dt <= duration_s:
            period, duty = self.period_s * rng.uniform(0.6, 1.6), rng.uniform(0.15, 0.85)
            resting = rng.random() < 0.25
            parts.append(
                np.zeros(round(0.4 / dt)) if resting else pulse_width(period, duty, float(rng.integers(1, 4)), dt)[:-1]
            )
        return np.asarray(self.amplitude_V * np.concatenate(parts)[: round(duration_s / dt) + 1])


@dataclass(frozen=True)
class RandomVoltage:
    """Seven sines of 0.05 to 2 Hz for a coil, each 0.2 to 0.4 of the amplitude, faded in over half a second."""

    amplitude_V: float = 1.6

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        return self.amplitude_V * self.wave(duration_s, dt, rng)

    @staticmethod
    def wave(duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        t = np.arange(round(duration_s / dt) + 1) * dt
        frequencies = np.geomspace(0.05, 2.0, 7) * rng.uniform(0.8, 1.25, 7)
        turns = [2 * np.pi * f * t + rng.uniform(0, 2 * np.pi) for f in frequencies]
        wave = np.sum([rng.uniform(0.2, 0.4) * np.sin(turn) for turn in turns], axis=0)
        return np.asarray(wave * np.clip(t / 0.5, 0, 1))


@dataclass(frozen=True)
class RandomForce:
    """The same wave as the force in N (torque in N m) on an axis."""

    amplitude: float

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        return self.amplitude * RandomVoltage.wave(duration_s, dt, rng)


@dataclass(frozen=True)
class Recorded:
    """A column of a CSV file, linear between samples; the path is relative to the scenario's folder."""

    path: str
    column: str
    folder: str = "."

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        file = Path(self.folder) / self.path
        table = read_table(file, self._check)
        if not len(table.lines):
            raise ValueError(f"{file}: record must have samples; got none")
        time, column = (table.values[:, table.header.index(name)] for name in ("t_s", self.column))
        t = dt * np.arange(round(duration_s / dt) + 1)
        return np.asarray(np.interp(t, time - time[0], column))

    def _check(self, header: list[str], _: Mapping[str, str]) -> Sequence[str]:
        for name in ("t_s", self.column):
            if name not in header:
                raise ValueError(f"columns of {self.path} must hold {name}; got {', '.join(header)[:200]}")
        return ("t_s", self.column)


PROFILES: Final[dict[str, type[Profile]]] = {
    "random_runs": RandomRuns,
    "wander": Wander,
    "runs": Runs,
    "constant_speed": ConstantSpeed,
    "sine": SineProfile,
    "pwm": Pwm,
    "random_pulses": RandomPulses,
    "random_voltage": RandomVoltage,
    "random_force": RandomForce,
    "record": Recorded,
}
