"""One record as the checks look at it: its columns, its clock, its motion, its noise."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch
from scipy.special import gammaincinv

from models.checks.finding import RecordFinding, Severity
from models.checks.settings import SET
from models.files.toml import inline_table
from models.files.units import unit_of
from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
_OVERLAPPED = 0.95  # of the degrees of freedom of windows that overlap by half, what they count (Welch 1967)


@dataclass(frozen=True)
class View:
    """A record of `rig` with what several checks need of it. All arrays have the record's rows, SI units."""

    record: Record
    rig: Rig

    @property
    def kind(self) -> RigKind:
        """The rig's kind."""
        return KINDS[self.rig.kind]

    @cached_property
    def timed(self) -> bool:
        """Whether the record is a time series."""
        return self.kind.layout.time and len(self.record) > 2

    @cached_property
    def measured(self) -> str:
        """Name of the (first) measured column."""
        return self.record.layout.measured[0]

    @cached_property
    def driven(self) -> str | None:
        """Name of the driven column; None where the record has none."""
        layout = self.record.layout
        names = layout.driven[0] if layout.driven else ()
        return next((name for name in names if name in self.record.columns), None)

    @cached_property
    def y(self) -> Array:
        """The measured column."""
        return self.record[self.measured]

    @cached_property
    def t(self) -> Array:
        """Time stamps in s as logged."""
        return self.record[TIME]

    @cached_property
    def dt(self) -> float:
        """The usual sampling interval in s."""
        steps = np.diff(self.t)
        good = steps[steps > 0]
        return float(np.median(good)) if len(good) else 1.0

    @cached_property
    def noise(self) -> float:
        """Standard deviation of white noise on the measured column."""
        return spectral_noise(self.y)[0] if self.kind.vibrates else white_noise(self.y)

    @cached_property
    def pushing(self) -> tuple[str, Array] | None:
        """What drives the capsule of a pull or a coil (of a logged current, or of a voltage over a known resistance):
        the column and the force in N that it stands for; None where no column tells it.
        """
        if self.kind.drawn and "force_N" in self.record.columns:
            return "force_N", self.record["force_N"]
        coil = self.rig.coil
        if not self.kind.pushed or coil is None or self.driven is None:
            return None
        ohm = 1.0 if self.driven == "coil_current_A" else coil.coil_resistance_Ohm
        return None if ohm is None else (self.driven, coil.force_constant_N_per_A / ohm * self.record[self.driven])

    @cached_property
    def moving_column(self) -> str:
        """The column that tells the motion: where the capsule or stage is, else the driven place."""
        return "position_m" if "position_m" in self.record.columns else str(self.driven)

    @property
    def turns(self) -> bool:
        """Whether the motion is that of an axis that turns, in rad."""
        return self.moving_column.endswith("_rad")

    def told(self, length: float) -> str:
        """A length in m (an angle in rad) of the motion in words."""
        return f"{length:.3g} rad" if self.turns else f"{1e3 * length:.3g} mm"

    @property
    def unit(self) -> str:
        """The unit of the measured column, as it is written."""
        return unit_of(self.measured).replace("_", " ")

    @cached_property
    def _smoothed(self) -> tuple[Array, float]:
        """Speed in m/s over the shortest of a few windows that shows more motion than noise, and its noise."""
        x = self.record[self.moving_column]
        noise = max(white_noise(x), grid_step(x) / np.sqrt(12))
        for window in SET.speed_windows_s:
            n = max(1, round(window / 2 / self.dt))
            smooth, centre = running_mean(x, n), running_mean(np.arange(len(x), dtype=np.float64), n)
            ahead = np.minimum(np.arange(len(x)) + n, len(x) - 1)
            back = np.maximum(np.arange(len(x)) - n, 0)
            speed = (smooth[ahead] - smooth[back]) / (np.maximum(centre[ahead] - centre[back], 0.5) * self.dt)
            left = noise * float(np.sqrt(2 / (2 * n + 1))) / (2 * n * self.dt)
            if 5 * left < SET.speed_shown * float(np.percentile(np.abs(speed), 90)):
                break
        return np.asarray(speed), left

    @property
    def speed(self) -> Array:
        """Speed in m/s of `moving_column`, rows that repeat a stamp taken as later by dt."""
        return self._smoothed[0]

    @property
    def speed_noise(self) -> float:
        """Standard deviation in m/s that the noise of `moving_column` leaves in `speed`."""
        return self._smoothed[1]

    @cached_property
    def moves(self) -> Mask:
        """Where the motion is faster than rest and its own noise."""
        fastest = float(np.percentile(np.abs(self.speed), 99))
        return np.asarray(np.abs(self.speed) > max(SET.still * fastest, 5 * self.speed_noise, 1e-7))

    @cached_property
    def rests(self) -> Mask:
        """Where nothing moves; under a vibrating mass where its drive is off, too."""
        still = ~self.moves
        return still & (self.record[self.driven] == 0) if self.kind.vibrates and self.driven else still

    def windows_at_rest(self, samples: int) -> Array:
        """Pieces of so many samples of the measured column at rest, 0.3 s and more after a motion, shape (n, samples);
        in that time a wall may still draw back.
        """
        after = round(SET.rest_settled_s / self.dt)
        rows = [
            self.y[k : k + samples] for a, b in runs_of(self.rests) for k in range(a + after, b - samples + 1, samples)
        ]
        return np.array(rows).reshape(-1, samples)

    @cached_property
    def strokes(self) -> list[tuple[int, int, float]]:
        """Stretches of motion one way (first row, row after the last, direction) that last 0.2 s or more."""
        least = max(3, round(SET.rest_stretch_s / self.dt))
        return [
            (a, b, direction)
            for direction in (1.0, -1.0)
            for a, b in runs_of(self.moves & (np.sign(self.speed) == direction))
            if b - a >= least
        ]

    def finding(self, name: str, severity: Severity, where: str, sentence: str, how: str, remedy: str) -> RecordFinding:
        """A finding about this record."""
        return RecordFinding(name, severity, self.record.source or self.record.name, where, sentence, how, remedy)

    def columns_line(self, target: str, **changed: Any) -> str:
        """The line of `[columns]` by which the rig file reads `target` with some keys `changed`."""
        return f"[columns] {target} = {inline_table(self.rig.columns.entry(target).table() | changed)}"

    def unit_line(self, target: str) -> str:
        """The line of `[columns]` that is to state the unit of what `target` is read from."""
        return f"{self.columns_line(target, unit='...')} with the unit of the file"

    def turned_line(self, target: str) -> str:
        """The line of `[columns]` that turns the sign of `target` round."""
        return self.columns_line(target, sign=-self.rig.columns.entry(target).sign)

    def at(self, rows: Sequence[int] | NDArray[np.int64], most: int = 3) -> str:
        """Lines and times of `rows` in words: the first few, and how many more."""
        shown = [self._place(int(row)) for row in list(rows)[:most]]
        return ", ".join(shown) + (f" and {len(rows) - most} more" if len(rows) > most else "")

    def _place(self, row: int) -> str:
        line = f"line {self.record.line(row)}"
        return f"{line} ({self.t[row]:.6g} s)" if self.timed else line


def running_mean(x: Array, n: int) -> Array:
    """Mean over `2 n + 1` neighbours, fewer at the ends; shape of `x`."""
    total = np.concatenate([[0.0], np.cumsum(x - x[0])])
    at = np.arange(len(x))
    low, high = np.maximum(at - n, 0), np.minimum(at + n + 1, len(x))
    return np.asarray((total[high] - total[low]) / (high - low) + x[0])


def white_noise(x: Array) -> float:
    """Standard deviation of white noise on `x`, from the median of its second differences, which motion hardly
    touches.
    """
    return float(np.median(np.abs(np.diff(x, 2)))) / 0.6745 / np.sqrt(6) if len(x) > 2 else 0.0


def spectral_noise(x: Array) -> tuple[float, bool]:
    """Standard deviation of white noise on `x`, from the quietest tenth of its spectrum (Welch, up to 256 samples a
    window): motion only adds to it, also one that a few samples a swing follow no longer. And whether the spectrum is
    flat there; where it is not, the motion is louder than the noise at every frequency and the value is a bound.
    """
    window = min(SET.spectrum_window, len(x) // 8)
    if window < 16:
        return white_noise(x), True
    _, power = welch(x, nperseg=window, detrend="linear")
    quietest, quiet = np.quantile(power[2:-1], [SET.spectrum_quietest, SET.spectrum_quiet])
    degrees = _OVERLAPPED * 2 * (2 * len(x) / window - 1)
    chance = (
        2 * gammaincinv(degrees / 2, SET.spectrum_quietest) / degrees
    )  # of white noise's mean, its quietest tenth by chi square
    std = float(np.sqrt(0.5 * quietest / chance))
    return std, bool(quiet < SET.spectrum_flat * quietest)


def runs_of(mask: Mask) -> list[tuple[int, int]]:
    """Stretches (first row, row after the last) where `mask` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def grid_step(x: Array) -> float:
    """Step of the grid on which the values of `x` lie; 0 where they lie on none that can be told."""
    values = np.unique(x)
    if len(values) < 3 or len(values) > 0.5 * len(x):
        return 0.0
    gaps = np.diff(values)
    gaps = gaps[gaps > 1e-9 * max(float(np.ptp(x)), 1e-300)]
    if not len(gaps):
        return 0.0
    step = float(np.percentile(gaps, 10))
    near = gaps[gaps < 1.5 * step]
    step = float(np.mean(near))
    off = np.abs(gaps / step - np.round(gaps / step))
    return step if float(np.mean(off < SET.grid_off)) > SET.grid_share else 0.0
