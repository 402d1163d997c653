"""All checks on all records of a series."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

from models.checks import clocks, excitation, inner_mass, noise, positions, sensor, signs, sizes, speeds, usable
from models.checks.finding import Findings, RecordFinding
from models.checks.sensor import without_outliers
from models.checks.usable import on_one_clock
from models.checks.view import View
from models.records.record import Record, where_measured
from models.rigs.rig import Rig

_ORDER: Final = ("stops", "weakens", "note")
_DRIFT: Final = "clock_drift"
Checks = tuple[Callable[[View], Findings], ...]
STAMPS: Final[Checks] = (
    clocks.check_interval,
    clocks.check_left_out,
    clocks.check_sparse_values,
    clocks.check_restart,
    clocks.check_repeats,
    clocks.check_uneven,
)
"""What the clock did: of all rows of a time series."""
MOTION: Final[Checks] = (excitation.check_information, usable.check_start)
"""What the motion can show: of the rows that are measured, without their outliers."""
INSTRUMENTS: Final[Checks] = (
    sensor.check_clipping,
    noise.check_colour,
    sensor.check_held_values,
    positions.check_jumps,
    noise.check_noise,
    sensor.check_no_values,
    sensor.check_outliers,
    positions.check_driven_resolution,
    noise.check_resolution,
    sensor.check_silence,
    noise.check_tones,
)
"""What the instruments did: of the rows that are measured."""
COLUMNS: Final[Checks] = (
    clocks.check_delay,
    signs.check_pull_exchanged,
    signs.check_same,
    inner_mass.check_inner_mass,
    sizes.check_magnets,
    signs.check_force_sign,
    signs.check_drive_sign,
    signs.check_cell_sign,
    speeds.check_logged_speed,
    speeds.check_repeated,
    positions.check_stuck,
    sizes.check_units,
    positions.check_wraps,
    signs.check_place_zero,
    signs.check_force_zero,
)
"""How the columns belong together: of these without their outliers."""


def examine(rig: Rig, records: Sequence[Record]) -> tuple[RecordFinding, ...]:
    """What all checks find in `records` of `rig`, the severest first. A check that the rig file accepts
    (`[checks] accept`) no longer stops: its finding weakens. Two clocks drift in all records alike: a drift that fewer
    than half of the records show in its direction is none.
    """
    found = [
        replace(finding, severity="weakens")
        if finding.severity == "stops" and finding.id in rig.checks.accept
        else finding
        for record in (on_one_clock(record, rig) for record in records)
        for finding in _of(View(record, rig))
    ]
    ways = Counter(finding.direction for finding in found if finding.id == _DRIFT)
    shared = {way for way, count in ways.items() if 2 * count >= len(records) and count > ways[-way]}
    found = [finding for finding in found if finding.id != _DRIFT or finding.direction in shared]
    return tuple(sorted(found, key=lambda finding: _ORDER.index(finding.severity)))


def _of(whole: View) -> Findings:
    """The stamps first: where they stop, nothing else can be judged of the measured rows."""
    if not whole.timed:
        yield from sizes.check_table(whole)
        return
    of_the_stamps = [finding for check in STAMPS for finding in check(whole)]
    yield from of_the_stamps
    if stopping(of_the_stamps) is None:
        measured = whole.of(where_measured(whole.record))
        sane = measured.of(without_outliers(measured))
        for view, checks in ((sane, MOTION), (measured, INSTRUMENTS), (sane, COLUMNS)):
            for check in checks:
                yield from check(view)


def stopping(findings: Sequence[RecordFinding]) -> RecordFinding | None:
    """The first finding that lets nothing be fitted; None where there is none."""
    return next((finding for finding in findings if finding.severity == "stops"), None)
