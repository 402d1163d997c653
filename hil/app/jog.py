"""`capsule jog`: steer a controller that leads, from the keyboard or by a script."""

import math
import os
import re
import select
import shutil
import sys
import termios
import time
import tty
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

from hil.app.console import TEXT, answer, note
from hil.app.run.clock import Clock, ClockedBus, Grid
from hil.app.run.loop import StopSignals
from hil.app.run.machine import open_bus
from hil.app.scenario.bus_scenario import Step, steps
from hil.app.scenario.deployment import read_operator
from hil.app.shared_options import Json, argument, option
from hil.nodes.operator import OperatorLimits
from hil.nodes.operator_sender import CYCLE_S, OperatorSender, refusal_words, steering_words
from models.files.toml import check_word, in_file

HELD_S: Final = 0.15
"""A key counts as held for this long after the terminal last sent it; terminals repeat keys every 30 ms or so."""
QUIET_S: Final = 0.1  # How long to listen for another sender of the same name before anything is sent: five cycles
RELEASE_S: Final = 0.1  # for which a release is sent before and after
_FASTER: Final = 1.25  # by which a key changes the speed
_SHOWN_S: Final = 0.1  # between two lines on the terminal


def jog(
    path: Annotated[Path, argument("DEPLOYMENT.toml", reads="deployment file")],
    source: Annotated[str, option("--source", "NAME")] = "keyboard",
    script: Annotated[str | None, option("--script", "FILE")] = None,
    life_ms: Annotated[float, option("--life", "MS")] = 100.0,
    json_output: Json = False,
) -> int:
    """Send setpoints: 0 where a controller accepted all that were sent while held, else 1, or where another sends."""
    table, limits = read_operator(path)
    if limits.sources:
        check_word(source, f"{path}: --source", limits.sources)
    if script is None and not sys.stdin.isatty():
        raise ValueError("capsule jog must run in a terminal, for its keys; got another input: --script - reads it")
    planned = [] if script is None else _planned(script)
    with in_file(path):
        bus = ClockedBus(open_bus(table, path.parent), Clock())
    with bus, StopSignals().caught() as signals:
        sender = OperatorSender(bus, source, life_ms)
        time.sleep(QUIET_S)
        sender.listen()
        if sender.others:
            return _end(path, sender, json_output)
        _send(sender, [Step("release", 0.0, RELEASE_S)], signals)
        if script is None:
            note(TEXT("jog.keys"))
            with raw_terminal(sys.stdin.fileno()):
                _by_keys(sender, limits, signals)
            sys.stderr.write("\r\x1b[J")
        else:
            _send(sender, planned, signals)
        signals.wanted = ""
        _send(sender, [Step("release", 0.0, RELEASE_S)], signals)
    return _end(path, sender, json_output)


def _planned(script: str) -> list[Step]:
    if script == "-":
        return list(steps(sys.stdin, "standard input"))
    try:
        return list(steps(Path(script).read_text(encoding="utf-8").splitlines(), script))
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{script}: script must be a text file that can be read; got: {error}") from None


def _cycles(signals: StopSignals, seconds: float = math.inf) -> Iterator[float]:
    """The time in s, once a cycle, for `seconds` or until a signal."""
    grid = Grid(Clock(), CYCLE_S)
    while (grid.ticks + grid.missed) * CYCLE_S < seconds and not signals.wanted:
        yield grid.wait()


def _send(sender: OperatorSender, planned: Iterable[Step], signals: StopSignals) -> None:
    for step in planned:
        for _ in _cycles(signals, step.seconds):
            sender.steer(step.mode, step.value)
            sender.listen()


def _by_keys(sender: OperatorSender, limits: OperatorLimits, signals: StopSignals) -> None:
    speed, direction, until, shown = limits.speed_m_s, 0.0, -math.inf, -math.inf
    for now in _cycles(signals):
        for key in keys(sys.stdin.fileno()):
            if key == "quit":
                return
            if key in ("left", "right"):
                direction, until = (1.0 if key == "right" else -1.0), now + HELD_S
            elif key == "release":
                until = now
            else:
                speed = min(speed * _FASTER, limits.speed_m_s) if key == "up" else speed / _FASTER
        if now < until:
            sender.speed(direction * speed)
        else:
            sender.release()
        sender.listen()
        if now - shown >= _SHOWN_S:
            shown = now
            line = f"{1e3 * speed:.2f} mm/s  {steering_words(sender.answer, sender.led, sender.source)}"
            rows = (len(line) - 1) // shutil.get_terminal_size().columns
            sys.stderr.write(f"\r\x1b[J{line}" + f"\x1b[{rows}A" * (rows > 0))
            sys.stderr.flush()


def _end(path: Path, sender: OperatorSender, json_output: bool) -> int:
    newest, unsent = sender.answer, sender.transmitter.unsent
    counts = {"sent": sender.sent - unsent, "unsent": unsent, "answers": sender.answers, "taken": sender.taken}
    last = None if newest is None else {name: getattr(newest, name) for name in newest.__slots__}
    state = steering_words(newest, sender.led, sender.source)
    more = {"refused": dict(sender.refused), "others": sender.others, "last": last, "state": state}
    said = [TEXT("jog.sent", count=counts["sent"], answer=state)]
    if sender.refused:
        count, last_source = sender.refused.total(), newest.source if newest is not None else ""
        said.append(TEXT("jog.refusals", count=count, held=sender.taken + count))
        said += [TEXT("jog.reason", n=n, why=refusal_words(w, last_source)) for w, n in sorted(sender.refused.items())]
    if sender.others:
        said.append(TEXT("jog.twin", source=sender.source))
    answer(json_output, {"deployment": str(path), **counts, **more}, "; ".join(said))
    return 0 if newest is not None and not sender.refused and not sender.others else 1


_ARROWS: Final = {"C": "right", "D": "left", "A": "up", "B": "down"}
KEYS: Final = {
    **{f"\x1b{mode}{letter}": name for mode in "[O" for letter, name in _ARROWS.items()},
    **dict.fromkeys(("\x1b", "q", "\x03", "\x04"), "quit"),
    " ": "release",
}
_KEY: Final = re.compile("|".join(map(re.escape, KEYS)))


@contextmanager
def raw_terminal(descriptor: int) -> Iterator[None]:
    """Within it keys come at once and are not echoed; the terminal is restored in every case."""
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor, termios.TCSANOW)
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def keys(descriptor: int) -> list[str]:
    """The keys pressed since the last call, by the names of `KEYS`, without waiting; a lost terminal is "quit"."""
    text = b""
    while len(text) < 4096 and select.select([descriptor], [], [], 0)[0]:
        try:
            more = os.read(descriptor, 256)
        except OSError:
            more = b""
        if not more:
            return ["quit"]
        text += more
    return [KEYS[key] for key in _KEY.findall(text.decode("utf-8", "replace"))]
