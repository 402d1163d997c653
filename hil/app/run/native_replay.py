"""`capsule replay` of a native node's log: the exported folder that the log lies in runs its node again."""

import shutil
import subprocess
from pathlib import Path
from typing import Final

from hil.app.run.differences import Difference, Replay
from models.files.access import check_source

_PROGRAM: Final = "build/replay_node"
_LONGEST_S: Final = 600.0
Frame = tuple[int, bytes]


def native_replay(path: Path) -> tuple[Replay, bool]:
    """What the node's replay found, and whether the log is whole. Raises ValueError of one sentence."""
    check_source(path, "log")
    folder = next((one for one in path.absolute().parents if (one / "node" / "replay.c").is_file()), None)
    if folder is None:
        raise ValueError(
            f"{path}: log must be the .blf file of a run, or lie in the exported folder of the node that wrote it; got"
            " neither, and other formats keep neither times to the ns nor notes"
        )
    _run([shutil.which("make") or "make", "-s", _PROGRAM], folder)
    *lines, last = _run([f"./{_PROGRAM}", str(path.absolute())], folder).splitlines()
    ticks, frames, end = last.split()
    return Replay(int(ticks), int(frames), 0, tuple(map(_difference, lines))), end == "whole"


def _run(command: list[str], folder: Path) -> str:
    try:
        ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_LONGEST_S, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        why = " ".join(str(getattr(error, "stderr", "") or error).split())[:300]
        raise ValueError(f"{folder}: exported folder must build its replay; got: {why}") from None
    return ran.stdout


def _difference(line: str) -> Difference:
    _, tick, time_s, *pair = line.split()
    logged, computed = (() if one == "-" else (_frame(one),) for one in pair)
    return Difference(int(tick), float(time_s), logged, computed)


def _frame(text: str) -> Frame:
    number, _, data = text.partition("#")
    return int(number, 16), bytes.fromhex(data)
