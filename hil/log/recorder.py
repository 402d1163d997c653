"""What a controller node leaves in its log: every frame in its own order, the operator's words, and times to the last
bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from subprocess import run
from typing import Any, Final

import can

from controller.limits import Limits
from controller.signals import Action
from hil.bus.catalogue import Catalogue
from hil.log.log import NodeLog

START, STOP, UNSOLVED, CUT, EXACT = range(1, 6)
"""Notes in a log: the operator's start (value: origin of the reference in s) and stop, a tick that is computed without
a solution, after how many steps the clock cut the plan of the tick before short, the time of the next frame where it is
no whole number of ns.
"""
_GIT_S: Final = 5


class Recorder:
    """The observer of a controller node. The order of what it writes is the order in which the node acted: that is what
    a replay needs.
    """

    def __init__(self, log: NodeLog, dry_run: bool = False) -> None:
        self.log, self._dry = log, dry_run

    def __call__(self, message: can.Message) -> None:
        """Write one frame."""
        time_s = message.timestamp
        if round(time_s * 1e9) / 1e9 != time_s:
            self.log.noted(time_s, EXACT, time_s)
        if message.is_rx:
            self.log.received(time_s, message.arbitration_id, message.data)
        else:
            self.log.sent(time_s, message.arbitration_id, message.data, withheld=self._dry)

    def start(self, now: float, origin_s: float) -> None:
        """The operator's start, just before `ControllerNode.start(now, origin_s)`."""
        self.log.noted(now, START, origin_s)

    def stop(self, now: float) -> None:
        """The operator's stop, just before `ControllerNode.stop()`."""
        self.log.noted(now, STOP)

    def unsolved(self, now: float) -> None:
        """Just before `ControllerNode.tick(now, solved=False)`."""
        self.log.noted(now, UNSOLVED)

    def ticked(self, now: float, action: Action) -> None:
        """After a tick at `now`, whose plan the clock may have cut short: a replay cuts it there again."""
        if action.cut_after is not None:
            self.log.noted(now, CUT, action.cut_after)


def log_record(
    described: Mapping[str, str],
    controller: str,
    values: Mapping[str, float],
    limits: Limits,
    catalogue: Catalogue,
    **more: Any,
) -> dict[str, Any]:
    """The record beside a log. `described` is {"deployment": text of a rig file} or {"scenario": text of a scenario
    file}; `values` the learned model's parameters; `more` what else is worth keeping. With it `capsule replay` builds
    the same controller again.
    """
    return {
        **described,
        "controller": controller,
        "values": dict(values),
        "limits": asdict(limits),
        "catalogue": catalogue.fingerprint,
        "code": code_version(),
        **more,
    }


def code_version() -> str:
    """The program's version and, in a checkout, its commit; "+" where files differ from it."""
    try:
        number = version("capsule-control")
    except PackageNotFoundError:
        number = "not installed"
    commit = _git("rev-parse", "--short=12", "HEAD")
    return f"{number} {commit}{'+' if _git('status', '--porcelain', '-uno') else ''}" if commit else number


def _git(*words: str) -> str:
    try:
        done = run(
            ["git", *words], cwd=Path(__file__).parent, capture_output=True, text=True, timeout=_GIT_S, check=False
        )
    except (OSError, TimeoutError, ValueError):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""
