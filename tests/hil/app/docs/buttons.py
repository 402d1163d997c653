"""The table of the cockpit's buttons in every state of drive and run, as the operator panel answers a page."""

from collections.abc import Iterator, Mapping
from itertools import groupby
from string import ascii_lowercase
from types import MappingProxyType
from typing import Any, Final

from tests.hil.app.cockpit.stage import BUTTONS, DRIVES, RUNS, Pressed, Seen, Stage, Walk, acted, settled

NAMES: Final = ("Start", "Reset fault", "Controlled stop", "Safe stop", "Steer", "Backward", "Forward", "Hold to move")
SPEED_M_S: Final = 2.5e-3  # at which the page's slider stands at first
ASKS: Final[Mapping[str, dict[str, Any]]] = MappingProxyType(
    {
        "start": {"ask": "start"},
        "reset": {"ask": "reset"},
        "stop": {"ask": "stop"},
        "safe": {"ask": "safe_stop"},
        "arm": {"ask": "arm", "on": True},
        "back": {"ask": "hold", "mode": "speed", "value": -SPEED_M_S},
        "forth": {"ask": "hold", "mode": "speed", "value": SPEED_M_S},
        "go": {"ask": "hold", "mode": "position", "value": 0.0},
    }
)
"""What the page asks for when a button is pressed."""
HELD: Final = ("back", "forth", "go")


def shown(run: str, drive: str) -> list[str]:
    """The buttons that the page shows: one of Start and Reset fault, and those of a hand that may steer."""
    state = RUNS[run]
    resets = drive == "fault" and not state.controller and not state.started
    hidden = {"start" if resets else "reset", *(() if state.accepts else HELD)}
    return [name for name in BUTTONS if name not in hidden]


def walked() -> Walk:
    """Every button of every state, pressed where it counts."""
    found = {}
    with acted():
        for accepts in (True, False):
            stage = Stage(accepts)
            for run, drive in [(r, d) for r in RUNS for d in DRIVES if RUNS[r].accepts == accepts]:
                stage.put(RUNS[run], drive)
                now = stage.panel.document(None)
                seen = {name: _pressed(stage, run, drive, name) for name in shown(run, drive)}
                stage.put(RUNS[run], drive)
                assert [name for name in ("start", "reset") if name in seen] == ["reset" if now["resets"] else "start"]
                found[run, drive] = stage.seen(seen)
            stage.panel._run = None
            stage.panel.close()
    return {key: found[key] for key in ((run, drive) for run in RUNS for drive in DRIVES)}


def _pressed(stage: Stage, run: str, drive: str, name: str) -> Pressed:
    stage.put(RUNS[run], drive)
    counts, tip = stage.panel.document("page")["buttons"][name]
    if not counts:
        return Pressed(False, settled(tip))
    if name in HELD:
        stage.panel.asked("page", ASKS["arm"])
    stage.begin()
    assert stage.panel.asked("page", ASKS[name]) == ""
    does, then = stage.outcome()
    stage.panel.left("page")
    return Pressed(True, settled(tip), does, then)


def table(walk: Walk) -> str:
    """Both tables: by state which buttons count, with letters; and what the letters say."""
    letters = _letters(walk)
    rows = [f"| run | drive | {' | '.join(NAMES)} | the card says |", "| --- " * (len(NAMES) + 3) + "|"]
    for run in RUNS:
        for cells, drives in groupby(DRIVES, lambda drive, run=run: _cells(walk[run, drive], letters)):
            names = ", ".join(drive.replace("_", " ") or "silent" for drive in drives)
            rows.append(f"| {run} | {names} | {cells} |")
    legend = ["| | the page says | a press | then the events say |", "| --- | --- | --- | --- |"]
    presses = [pressed for seen in walk.values() for pressed in seen.buttons.values()]
    for text, letter in letters.items():
        does, then = (
            " or ".join(dict.fromkeys(getattr(one, part) for one in presses if one.tip == text and getattr(one, part)))
            for part in ("does", "then")
        )
        legend.append(f"| {letter} | {text} | {does or '-'} | {then or '-'} |")
    return "\n".join([*rows, "", *legend])


def _cells(seen: Seen, letters: Mapping[str, str]) -> str:
    cells = []
    for name in BUTTONS:
        one = seen.buttons.get(name)
        cells.append("" if one is None else f"{'✓' if one.counts else '✗'} {letters[one.tip]}")
    return " | ".join([*cells, f"{letters[seen.words]}, {letters[seen.steering]}"])


def _letters(walk: Walk) -> dict[str, str]:
    """A letter for each sentence, in the order of the table."""
    texts = dict.fromkeys(text for seen in walk.values() for text in _texts(seen))
    names = [*ascii_lowercase, *(f"{a}{b}" for a in ascii_lowercase for b in ascii_lowercase)]
    return dict(zip(texts, names, strict=False))


def _texts(seen: Seen) -> Iterator[str]:
    yield from (seen.buttons[name].tip for name in BUTTONS if name in seen.buttons)
    yield from (seen.words, seen.steering)


def part() -> str:
    return table(walked())
