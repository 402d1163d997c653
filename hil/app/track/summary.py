"""The outcome of closed-loop runs in words and numbers, the same on the terminal and on the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from controller.supervision.fallback import DONE
from hil.app import console
from hil.app.scenario.model_use import chosen_words, health_words, offer_words
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.loop import LoopTrace
from hil.app.track.score import HARD
from hil.report.words import column_words
from models.words.quantities import fixed, number
from models.words.sentences import Sentences

Found = Mapping[str, Any]
TEXT: Final = Sentences(__file__)
HEADS: Final = (
    "rmse mm", "max mm", "final mm", "mean mm/s", "wall mN", "effort mN", "violations", "ticks not ok",
)  # fmt: skip
TIMES: Final = ("solve ms: median", "p99", "max", "estimate ms: median", "p99", "max")
_MOST_USED: Final = "largest use of a hard limit"
_WORDS: Final = ("controller", "check", HEADS[-1], _MOST_USED)
"""Columns that hold words."""


@dataclass(frozen=True)
class LoopRun:
    """A run of `scenario`: its JSON object `found`, its trace, and what is said of it in `lines`."""

    scenario: TrackScenario
    found: Found
    trace: LoopTrace
    lines: Sequence[str]


def headline(found: Sequence[Found]) -> str:
    """Scenario, controller, model and rms error of the best of the runs; how it ended, where that was early."""
    best = min(found, key=lambda one: (one["ended"] != DONE, one["tracking_rmse_m"]))
    if best["ended"] != DONE:
        return TEXT("all_ended" if len(found) > 1 else "ended", **best)
    return TEXT("best" if len(found) > 1 else "alone", **best)


def lines_of(found: Found) -> list[str]:
    """What a run of a loop came to: what leads and why, changes, how it ended, the monitor's verdict, the offer."""
    changes = [TEXT("stays" if e["after"] == e["before"] else "change", **e) for e in found["events"]]
    ended = "" if found["ended"] == DONE else f"ended: {found['ended']}"
    return [*filter(None, (chosen_words(found), *changes, ended, health_words(found), offer_words(found)))]


def say(head: str, runs: Sequence[LoopRun], page: Path | None) -> None:
    """Print what kind of run it was, the headline, the runs as tables, what is said of each, and where the page is."""
    found = [run.found for run in runs]
    console.say(head, headline(found))
    _print(HEADS, [[one["controller"], *tracking(one)] for one in found])
    _print([_MOST_USED], [[one["controller"], most_used(one)] for one in found])
    _print(TIMES, [[one["controller"], *times(one)] for one in found])
    if checks := check_rows(found):
        _print(("check", "value", "at most", "verdict"), checks)
    for run in runs:
        whose = f"{run.found['controller']}: " if len(runs) > 1 else ""
        console.say(*(f"{whose}{words}" for words in run.lines))
    if page is not None:
        console.say(f"report: {page}")


def check_rows(found: Sequence[Found]) -> list[list[str]]:
    """Controller, check, value, limit and verdict of each check."""
    return [
        [one["controller"], _check_words(check), number(check["value"]), number(check["limit"]), _verdict(check)]
        for one in found
        for check in one.get("checks", ())
    ]


def most_used(found: Found) -> str:
    """The limit of the true state that was used most: "gap 83 %"."""
    share, name = max((share, name) for name, share in found["limit_use"].items() if name in HARD)
    return f"{name} {100 * share:.0f} %"


def times(found: Found) -> list[str]:
    """Median, 99th percentile and maximum of the controller's and the estimator's time for a tick, in ms."""
    return [fixed(found[what][key], 3) for what in ("solve_ms", "estimate_ms") for key in ("median", "p99", "max")]


def tracking(found: Found) -> list[str]:
    """Errors in mm, mean speed in mm/s, forces in mN, violations, and the ticks that were not ok: "lost 5000"."""
    lengths = ("tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s")
    numbers = [fixed(1e3 * found[key], 3) for key in lengths]
    numbers += [fixed(1e3 * found[key], 1) for key in ("wall_force_max_N", "effort")]
    not_ok = ", ".join(f"{name} {n}" for name, n in found["ticks"].items() if n and name != "ok") or "none"
    return [*numbers, str(found["hard_violations"]), not_ok]


def _check_words(check: Found) -> str:
    """What a check compares, and its unit: "settling time, s"."""
    return ", ".join(filter(None, column_words(check["check"])))


def _verdict(check: Found) -> str:
    return "passed" if check["passed"] else "FAILED"


def _print(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = console.text_table("", ("controller", *heads), _WORDS, bare=True)
    for row in rows:
        table.add_row(*row)
    console.summary().print(table)
