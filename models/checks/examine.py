"""All checks on all records of a series, and which rows of a record a fit may use."""

import pkgutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from inspect import isfunction

import models.checks as here
from models.checks.finding import RecordFinding
from models.checks.instrument.outliers import without_outliers
from models.checks.one_clock import on_one_clock
from models.checks.view import View
from models.records.record import Record, where_measured
from models.rigs.rig import Rig

Check = Callable[[View], Sequence[RecordFinding]]
_CLOCK, _INSTRUMENT = "clock", "instrument"
_ORDER = ("stops", "weakens", "note")


@cache
def checks() -> tuple[Check, ...]:
    """The functions `check_...` of the modules in the folders of `models.checks`."""
    found: list[Check] = []
    for module in pkgutil.walk_packages(here.__path__, f"{here.__name__}."):
        if module.name.count(".") == 3:
            own = (value for value in vars(import_module(module.name)).values() if isfunction(value))
            found += [f for f in own if f.__name__.startswith("check_") and f.__module__ == module.name]
    return tuple(found)


def examine(rig: Rig, records: Sequence[Record]) -> tuple[RecordFinding, ...]:
    """What all checks find in `records` of `rig`, the severest first. A check that the rig file accepts
    (`[checks] accept`) no longer stops: its finding weakens.
    """
    found = [
        replace(finding, severity="weakens")
        if finding.severity == "stops" and finding.id in rig.checks.accept
        else finding
        for record in (on_one_clock(record, rig) for record in records)
        for finding in _of(View(record, rig), View(where_measured(record), rig))
    ]
    return tuple(sorted(found, key=lambda finding: _ORDER.index(finding.severity)))


def _of(whole: View, measured: View) -> Iterator[RecordFinding]:
    """The clock of the `whole` record first: where it stops, nothing else can be told of the rows that are measured.
    What the instruments did stands in these, what the wiring and the motion are without their outliers.
    """
    of_the_clock = [finding for check in checks() if _folder(check) == _CLOCK for finding in check(whole)]
    yield from of_the_clock
    if stopping(of_the_clock) is not None:
        return
    sane = View(without_outliers(measured), measured.rig)
    for check in checks():
        if _folder(check) != _CLOCK:
            yield from check(measured if _folder(check) == _INSTRUMENT else sane)


def _folder(check: Check) -> str:
    return check.__module__.split(".")[2]


def stopping(findings: Sequence[RecordFinding]) -> RecordFinding | None:
    """The first finding that lets nothing be fitted; None where there is none."""
    return next((finding for finding in findings if finding.severity == "stops"), None)
