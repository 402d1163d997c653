"""Keys of a terminal, one by one, without their being shown; the terminal is given back as it was."""

from __future__ import annotations

import os
import select
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

KEYS: Final = {
    "\x1b[C": "right",
    "\x1b[D": "left",
    "\x1b[A": "up",
    "\x1b[B": "down",
    "\x1bOC": "right",
    "\x1bOD": "left",
    "\x1bOA": "up",
    "\x1bOB": "down",
    "\x1b": "quit",
    "q": "quit",
    "\x03": "quit",
    "\x04": "quit",
    " ": "release",
}


@contextmanager
def raw_terminal(descriptor: int) -> Iterator[None]:
    """Within it keys come at once and are not shown; whatever ends it, the terminal is as it was."""
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor, termios.TCSANOW)
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def keys(descriptor: int) -> list[str]:
    """The keys that have been pressed since the last call, by the names of `KEYS`; others are left out. Never waits;
    a terminal that is gone is "quit".
    """
    text = b""
    while len(text) < 4096 and select.select([descriptor], [], [], 0)[0]:
        try:
            more = os.read(descriptor, 256)
        except OSError:
            more = b""
        if not more:
            return ["quit"]
        text += more
    return _named(text.decode("utf-8", "replace"))


def _named(text: str) -> list[str]:
    found, at = [], 0
    while at < len(text):
        length = next((n for n in (3, 1) if text[at : at + n] in KEYS), 0)
        if length:
            found.append(KEYS[text[at : at + length]])
        at += length or 1
    return found
