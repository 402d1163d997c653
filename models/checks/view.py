"""One record as the checks see it: columns, clock, motion and noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partialmethod
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from models.checks.estimators import Array, Mask, running_mean, runs_of, smooth_speed, spectral_noise, white_noise
from models.checks.finding import RecordFinding, Severity
from models.checks.settings import SET
from models.files.toml import inline_table
from models.files.units import unit_of
from models.records.record import Record
from models.rigs.columns import TIME
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)
Rows = Sequence[int] | NDArray[np.int64]
once: Final = lru_cache(maxsize=4)
"""Of a function of a view: computed once for each, as long as few others come between."""


@dataclass(frozen=True, eq=False)
class View:
    """A record of `rig` with what several checks need of it. All arrays have the record's rows, SI units."""

    record: Record
    rig: Rig

    def of(self, record: Record) -> "View":
        """The view of another `record` of the rig; this one, with all that it knows, where it is the same."""
        return self if record is self.record else View(record, self.rig)

    @property
    def kind(self) -> RigKind:
        """The record's kind."""
        return KINDS[self.record.kind]

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
    def unbroken(self) -> "View":
        """The longest stretch of the record without a pause."""
        edges = [0, *(np.flatnonzero(np.diff(self.t) > SET.stamps_pause * self.dt) + 1), len(self.t)]
        first, last = max(pairwise(edges), key=lambda piece: piece[1] - piece[0])
        return self.of(self.record.rows(slice(first, last))) if last - first < len(self.t) else self

    @cached_property
    def noise(self) -> float:
        """Standard deviation of white noise on the measured column."""
        return spectral_noise(self.y)[0] if self.kind.vibrates else white_noise(self.y)

    @cached_property
    def pushing(self) -> tuple[str, Array] | None:
        """The column that drives a pull or a coil, and its force in N; None where that is not known."""
        if self.kind.drawn and "force_N" in self.record.columns:
            return "force_N", self.record["force_N"]
        coil = self.rig.coil
        if not self.kind.pushed or coil is None or self.driven is None:
            return None
        ohm = 1.0 if self.driven == "coil_current_A" else coil.coil_resistance_Ohm
        return None if ohm is None else (self.driven, coil.force_constant_N_per_A / ohm * self.record[self.driven])

    @cached_property
    def moving_column(self) -> str:
        """The column of the motion: the position of the capsule or stage, else the driven position."""
        if self.kind.stage:
            return self.measured if self.kind.drive else str(self.driven)
        return "position_m" if "position_m" in self.record.columns else str(self.driven)

    @property
    def turns(self) -> bool:
        """Whether the motion is that of an axis that turns, in rad."""
        return self.moving_column.endswith("_rad")

    def length(self, value: float, rate: str = "") -> Quantity:
        """A length of the motion in m, an angle in rad; a speed with the `rate` "/s"."""
        return Quantity(value, f"{'rad' if self.turns else 'm'}{rate}")

    def of_measured(self, value: float) -> Quantity:
        """A value of the measured column."""
        return Quantity(value, unit_of(self.measured).replace("_", " "))

    @cached_property
    def _smoothed(self) -> tuple[Array, float]:
        """Speed in m/s and its noise."""
        return smooth_speed(self.record[self.moving_column], self.dt)[:2]

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
        """Pieces of the measured column at rest, (n, samples), 0.3 s and more after a motion: a wall may draw back."""
        still = self.rests & (np.abs(self.speed) <= max(5 * self.speed_noise, 1e-7))
        after = round(SET.rest_settled_s / self.dt)
        rows = [self.y[k : k + samples] for a, b in runs_of(still) for k in range(a + after, b - samples + 1, samples)]
        return np.array(rows).reshape(-1, samples)

    def strokes(self, least_s: float = SET.rest_stretch_s, rows: int = 3) -> list[tuple[int, int, float]]:
        """Stretches of motion in one direction (first row, row after the last, sign), at least so long."""
        least = max(rows, round(least_s / self.dt))
        both = ((sign, self.moves & (np.sign(self.speed) == sign)) for sign in (1.0, -1.0))
        return sorted((a, b, sign) for sign, there in both for a, b in runs_of(there, least))

    def ends(self, signal: Array, sign: float) -> Array:
        """Means of `signal` over the later halves of the strokes in one direction, where friction has built up."""
        return np.array([np.mean(signal[(a + b) // 2 : b]) for a, b, own in self.strokes() if own == sign])

    def averaged(self, x: Array, seconds: float) -> Array:
        """The running mean of `x` over so many s on either side."""
        return running_mean(x, max(1, round(seconds / self.dt)))

    def finding(
        self,
        severity: Severity,
        case: str,
        column: str = "",
        rows: Rows | str = "throughout",
        beside: str = "",
        **values: Any,
    ) -> RecordFinding:
        """A finding about a `column` of this record (default: the measured one) in these `rows`, `beside` another.
        Its texts are the table `case` of `sentences.toml`, filled with `values`; its id is the first name of `case`.
        """
        names = {"column": column or self.measured, "measured": self.measured, "driven": self.driven}
        said, how, remedy = (_text(case, part, names | values) for part in ("sentence", "how", "remedy"))
        against = f" against {beside}" if beside else ""
        where = f"{names['column']}{against}, {rows if isinstance(rows, str) else self.at(rows)}"
        name, direction = case.partition(".")[0], (1 if values["later"] else -1) if "later" in values else 0
        file = self.record.source or self.record.name
        return RecordFinding(name, severity, file, where, said, how, remedy, direction)

    stops = partialmethod(finding, "stops")
    weakens = partialmethod(finding, "weakens")
    notes = partialmethod(finding, "note")
    """Findings of one severity."""

    def columns_line(self, target: str, **changed: Any) -> str:
        """The line of `[columns]` by which the rig file reads `target` with some keys `changed`."""
        return f"[columns] {target} = {inline_table(self.rig.columns.entry(target).table() | changed)}"

    def unit_line(self, target: str) -> str:
        """The line of `[columns]` that is to state the unit of the column that `target` is read from."""
        return self.columns_line(target, unit="...")

    def turned_line(self, target: str) -> str:
        """The line of `[columns]` that changes the sign of `target`."""
        return self.columns_line(target, sign=-self.rig.columns.entry(target).sign)

    def at(self, rows: Rows, most: int = 3) -> str:
        """Lines and times of `rows` in words: the first few, and how many more."""
        times = [f" ({self.t[row]:.6g} s)" if self.timed else "" for row in rows[:most]]
        shown = [f"{self.record.line(row)}{time}" for row, time in zip(rows, times, strict=False)]
        return ", ".join(shown) + (f" and {len(rows) - most} more" if len(rows) > most else "")


def _text(case: str, part: str, values: Mapping[str, Any]) -> str:
    """A `part` of the texts of `case`, or of the finding that it is a case of: "units.follows" is a case of "units"."""
    while f"{case}.{part}" not in TEXT:
        case = case.rpartition(".")[0]
    return TEXT(f"{case}.{part}", **values)
