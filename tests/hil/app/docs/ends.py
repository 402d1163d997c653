"""How commands end: statuses and what is said; `tests/hil/app/test_ends.py` brings each end about."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple


class End(NamedTuple):
    """An exit status, what happened, and what is said then: `...` stands for what differs."""

    status: int
    meaning: str
    sentence: str


RUN_ENDS: Final[Mapping[str, End]] = MappingProxyType(
    {
        "done": End(0, "led for all of `duration_s`; with `--dry-run` it would have led", "done"),
        "operator": End(0, "led until Ctrl-C, SIGTERM or SIGHUP asked for a stop", "controlled stop (SIG...)"),
        "reset": End(
            0,
            "`reset`: the drive has no latched fault, or none any more",
            "drive fault ... is acknowledged; the drive is in standby",
        ),
        "cancelled": End(1, "Ctrl-C, SIGTERM or SIGHUP before the drive was enabled", "SIG... before ... was enabled"),
        "other_controller": End(
            1,
            "another controller speaks on the bus: before leading nothing was sent",
            "another controller is on the bus (...)",
        ),
        "no_drive": End(
            1,
            "no drive that can be led was heard within 2 s: silent, or with another fingerprint of `capsule.dbc`",
            "nothing to lead: no feedback of the drive...",
        ),
        "drive_fault": End(
            1,
            "the drive has latched a fault: `capsule run RIG.toml reset` acknowledges it",
            "nothing to lead: drive fault ...; 'capsule run RIG.toml reset' acknowledges it",
        ),
        "not_reset": End(
            1, "`reset`: the fault stays, its cause is still there", "drive fault ... stays: its cause is still there"
        ),
        "gave_up": End(
            1,
            "the drive was not enabled within `control.give_up_s`",
            "gave up: the drive was not enabled within ... s: ...",
        ),
        "stopped": End(1, "the controller stopped by itself, for the reason in `ended`", "localisation lost..."),
        "sensor_or_drive": End(
            1,
            "localisation, drive and capsule contradict each other, in the probe or while it led",
            "sensor or drive contradict each other: ...",
        ),
        "no_rest": End(
            1,
            "the drive moved while it was not enabled: before it was led, or after the stop",
            "... the drive does not rest: ...",
        ),
        "safe_stop": End(
            1, "an operator's safe stop, in the cockpit or by a switch on the bus", "safe stop by an operator"
        ),
        "not_led": End(
            1,
            "another controller than the one asked for led more than 1 % of the ticks, or the model broke after the"
            " localisation had jumped",
            "... must lead 99 % of the ticks; led: ...",
        ),
        "log": End(1, "as asked, but frames are missing in the log", "...; log ...: ... frames are missing"),
    }
)
"""Of `capsule run`: `end` in its JSON is the key, `ended` the sentence."""
ENDS: Final[Mapping[str, Mapping[str, End]]] = MappingProxyType(
    {
        "run": RUN_ENDS,
        "run check": {
            "good": End(0, "nothing is bad", "ok  bus: ..."),
            "bad": End(1, "something is bad", "BAD drive Carriage: ..."),
        },
        "jog": {
            "answered": End(0, "a controller has answered", "... setpoints sent; ... at ... mm"),
            "unanswered": End(
                1,
                "no controller has answered",
                "... setpoints sent; no controller runs: start one ...",
            ),
        },
        "plant": {"over": End(0, "`--seconds` are over, or Ctrl-C, SIGTERM or SIGHUP", "ready")},
        "sil": {
            "done": End(0, "led to the end of the scenario", "...: ... with the ... model tracks within ... rms"),
            "stopped": End(1, "the controller stopped by itself, or never led", "ended: ..."),
            "not_led": End(1, "as of `run`", "ended: ... must lead 99 % of the ticks; led: ..."),
        },
        "replay": {
            "identical": End(0, "all frames of a whole log are the same", "... ticks, ... frames: identical"),
            "different": End(1, "frames differ", "... ticks, ... frames: ... ticks differ..."),
            "cut_off": End(
                1,
                "the log holds less than its record states, or the record states nothing",
                "... ticks, ... frames: identical as far as the log goes; ...",
            ),
        },
        "cockpit": {"closed": End(0, "Ctrl-C, SIGTERM or SIGHUP", "cockpit: http://...")},
        "each of them": {
            "refused": End(2, "the input cannot be used", "capsule: ... must ...; got ..."),
            "short": End(
                2,
                "too little memory or too few open files are allowed",
                "capsule: memory must be at least ... kB (ulimit -v); got a limit of ... kB",
            ),
            "unwritten": End(
                1,
                "the end would have been 0, but standard output is full, closed or read by nobody",
                "capsule: standard output must take the result; got: ...",
            ),
            "interrupted": End(
                130, "Ctrl-C where there is nothing to stop in a controlled way", "capsule: interrupted: ..."
            ),
        },
    }
)
"""By command."""


def table() -> str:
    rows = ["| command | end | status | what happened | it says |", "| --- | --- | --- | --- | --- |"]
    rows += [
        f"| {command} | `{name}` | {end.status} | {end.meaning} | {end.sentence} |"
        for command, ends in ENDS.items()
        for name, end in ends.items()
    ]
    return "\n".join(rows)
