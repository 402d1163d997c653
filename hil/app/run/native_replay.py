"""What a replay finds; `capsule replay` of a native node's log: the exported folder it lies in runs its node again."""

import shutil
import subprocess
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Final

from hil.bus.catalogue import FrameCatalogue
from models.files.access import check_source
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
_PROGRAM: Final = "build/replay_node"
_LONGEST_S: Final = 600.0
Frame = tuple[int, bytes]


@dataclass(frozen=True)
class Difference:
    """A tick whose frames differ: (identifier, data) as logged and as computed."""

    tick: int
    time_s: float
    logged: tuple[tuple[int, bytes], ...]
    computed: tuple[tuple[int, bytes], ...]

    def words(self, catalogue: FrameCatalogue) -> str:
        names = catalogue.by_id()

        def shown(frame: tuple[int, bytes] | None) -> str:
            if frame is None:
                return "nothing"
            number, data = frame
            return f"{names[number].name if number in names else hex(number)} {data.hex()}"

        logged, computed = next(pair for pair in zip_longest(self.logged, self.computed) if pair[0] != pair[1])
        both = {"logged": shown(logged), "computed": shown(computed)}
        return TEXT("replay.tick", tick=self.tick, time=self.time_s, **both)


@dataclass(frozen=True)
class Replay:
    """What a replay found; the plans of `cut` ticks were cut short by the clock, and again in the replay."""

    ticks: int
    frames: int
    cut: int
    differences: tuple[Difference, ...]

    @property
    def identical(self) -> bool:
        return not self.differences


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
