"""What `capsule track` prints: how well each controller tracked, what it took of limits and time, and the verdicts."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from controller.supervision.fallback import DONE
from hil.app import console
from hil.app.scenario.model_offer import offer_words
from hil.app.scenario.model_use import health_words
from hil.app.scenario.scenario import TrackScenario
from hil.app.track.score import HARD
from models.words.quantities import fixed, number

Found = Mapping[str, Any]
_WORDS: Final = ("controller", "check", "ticks not ok", "most of a hard limit")
"""Columns that hold words."""


def say(scenario: TrackScenario, found: Sequence[Found], out: Path | None) -> None:
    """Print the JSON objects of a scenario's runs as tables, and where the report is."""
    seconds = f"{scenario.duration_s:g} s, seed {found[0]['seed']}"
    console.say(f"{scenario.name}: {scenario.kind} rig, {seconds}, {found[0]['model']} model")
    heads = ("rmse mm", "max mm", "final mm", "mean mm/s", "wall mN", "effort mN", "violations")
    _print(heads, [[one["controller"], *tracking(one)] for one in found])
    _print(_WORDS[2:], [[one["controller"], not_ok(one), most_used(one)] for one in found])
    steps = ("solve ms: median", "p99", "max", "estimate ms: median", "p99", "max")
    _print(steps, [[one["controller"], *times(one)] for one in found])
    checks = [
        [one["controller"], check["check"], number(check["value"]), number(check["limit"]), verdict(check)]
        for one in found
        for check in one["checks"]
    ]
    if checks:
        _print(("check", "value", "at most", "verdict"), checks)
    for one in found:
        ended = "" if one["ended"] == DONE else f"ended: {one['ended']}"
        told = (*map(_change, one["events"]), ended, health_words(one), offer_words(one))
        console.say(*(f"{one['controller']}: {words}" for words in told if words))
    if out is not None:
        console.say(f"report: {out / 'track.html'}")


def not_ok(found: Found) -> str:
    """Ticks by status, those that went well aside: "lost 5000, limited 12"."""
    return ", ".join(f"{name} {n}" for name, n in found["ticks"].items() if n and name != "ok") or "none"


def most_used(found: Found) -> str:
    """The limit of the true state of which the largest share was used: "gap 83 %"."""
    name, share = max(
        ((name, share) for name, share in found["limit_use"].items() if name in HARD), key=lambda item: item[1]
    )
    return f"{name} {100 * share:.0f} %"


def times(found: Found) -> list[str]:
    """Median, 99th percentile and maximum of the controller's and the estimator's time for a tick, in ms."""
    return [fixed(found[what][key], 3) for what in ("solve_ms", "estimate_ms") for key in ("median", "p99", "max")]


def verdict(check: Mapping[str, Any]) -> str:
    return "passed" if check["passed"] else "FAILED"


def _change(event: Mapping[str, Any]) -> str:
    return f"from {event['time_s']:.3f} s on {event['after']} in place of {event['before']}: {event['reason']}"


def tracking(one: Found) -> list[str]:
    """Errors in mm, mean speed in mm/s, forces in mN, and violations."""
    lengths = ("tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s")
    numbers = [fixed(1e3 * one[key], 3) for key in lengths]
    numbers += [fixed(1e3 * one[key], 1) for key in ("wall_force_max_N", "effort")]
    return [*numbers, str(one["hard_violations"])]


def _print(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = console.text_table("", ("controller", *heads), _WORDS, bare=True)
    for row in rows:
        table.add_row(*row)
    console.summary().print(table)
