"""Each command that runs for long, all side by side, and how its memory grows: `python -m tests.bench.bench_soak`.

One plant, led by `capsule run`, steered by `capsule jog` (a script), shown by `capsule cockpit` to one open page, and a
campaign with one worker of two, for `--seconds`. Every `--every` s the resident memory of each command with its
processes is read (of the campaign its workers: who began it keeps a row of each run). Told is the growth in MB/h: the
slope of the least-squares line through the samples that are later than `--warm-up` after each process has loaded,
every life with a level of its own. A command that ends before its time (a machine that held `run` up for longer than a
command lives) is begun again and counted. Status 1 where one grows by more than `BOUND_MB_H`, or was never measured.
"""

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.bench.bench_cockpit import CAPSULE, ENVIRONMENT, Page, files, memory_MB
from tests.places import ROOT

BOUND_MB_H: Final = 4.0
"""Above what an allocator's pages wander in an hour; a plant that kept its truth grew by 1,800."""
RUN_S: Final = 3590.0
"""As long as a `hold` may be; `run` is begun again then."""
LEAST: Final = 10
"""Samples without which a slope is none."""
LOADED: Final = 0.9
"""A busy machine takes minutes to load a command; until then it grows."""
_ENDS_S: Final = 20.0
_STEERED_S: Final = 7.0
CAMPAIGN: Final = """[campaign]
scenario = "{scenario}"
cases = {cases}
seed = 1
chunk = 4
[draw."anatomy.seed"]
integer = [0, 1000000]
[grid]
"scenario.duration_s" = [4.0]
"control.controller" = ["pid_friction", "mpc"]
"""


@dataclass
class Soaked:
    """A command: its words, whether its children alone count, its process, and for each of its lives the samples
    (time in s since it began, MB).
    """

    name: str
    words: Sequence[str]
    children_only: bool = False
    process: subprocess.Popen[bytes] | None = None
    began: float = 0.0
    lives: list[list[tuple[float, float]]] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)

    def begin(self, folder: Path, priority: int = 0) -> None:
        """Begin, or begin again."""
        out, error = ((folder / f"{self.name}.{kind}").open("wb") for kind in ("out", "err"))
        with out, error:
            words = [*CAPSULE, *self.words]
            self.process = subprocess.Popen(words, stdout=out, stderr=error, env=ENVIRONMENT, cwd=folder)
        self.began = time.monotonic()
        self.lives.append([])

    def sample(self) -> None:
        """Read the memory now."""
        assert self.process is not None
        pids = list(tree(self.process.pid))
        held = sum(memory(pid) for pid in (pids[1:] if self.children_only else pids))
        if held:
            self.lives[-1].append((time.monotonic() - self.began, held))

    def growth(self, warm_up_s: float) -> dict[str, Any]:
        """Slope over all lives, in MB/h, and what else is told."""
        kept = [np.array(settled(life, warm_up_s)).reshape(-1, 2) for life in self.lives]
        kept = [life - life.mean(axis=0) for life in kept if len(life) >= LEAST]
        spread = sum(float(life[:, 0] @ life[:, 0]) for life in kept)
        slope = sum(float(life[:, 0] @ life[:, 1]) for life in kept) / spread * 3600.0 if spread else None
        everything = [s for life in self.lives for s in life]
        last = [mb for _, mb in self.lives[-1]]
        return {
            "growth_MB_h": slope,
            "samples": sum(map(len, kept)),
            "MB": last[-1] if last else None,
            "most_MB": max((mb for _, mb in everything), default=None),
            "lives": len(self.lives),
            "ends": self.ends,
            "series": [[(round(t), round(mb, 1)) for t, mb in life] for life in self.lives],
        }


def settled(life: Sequence[tuple[float, float]], warm_up_s: float) -> list[tuple[float, float]]:
    """The samples of a life from `warm_up_s` on after it has come to `LOADED` of what it held at its end."""
    loaded = next((t for t, mb in life if mb >= LOADED * life[-1][1]), 0.0)
    return [(t, mb) for t, mb in life if t >= loaded + warm_up_s]


def tree(pid: int) -> Iterator[int]:
    """A process and all below it."""
    yield pid
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        threads = Path(f"/proc/{pid}/task").iterdir()
        for thread in threads:
            if thread.name != str(pid):
                children += (thread / "children").read_text().split()
    except OSError:
        return
    for child in children:
        yield from tree(int(child))


def memory(pid: int) -> float:
    """Resident memory in MB, 0 of a process that is gone."""
    try:
        return memory_MB(pid)
    except (OSError, IndexError):
        return 0.0


def commands(folder: Path, seconds: float) -> list[Soaked]:
    """What is run, the plant first. Files lie in `folder`."""
    path = files(folder, RUN_S)
    text = path.read_text().replace("accept = false", "accept = true")
    path.write_text(text.replace('kind = "ramp"\nspeed_mm_s = 2.0\nstart_s = 0.5', 'kind = "hold"'))
    steps = "release 1\nspeed 2 1.5\nspeed -2 1.5\nrelease 3\n"
    (folder / "script.txt").write_text(steps * (2 + int(seconds / _STEERED_S)))
    scenario = ROOT / "hil" / "scenarios" / "track_magnetic_ramp.toml"
    (folder / "campaign.toml").write_text(CAMPAIGN.format(scenario=scenario, cases=10 + int(seconds)))
    return [
        Soaked("plant", ["plant", str(path), "--json"]),
        Soaked("run", ["run", str(path), "--log", str(folder / "soak.blf"), "--json"]),
        Soaked("cockpit", ["cockpit", str(path), "--port", "0", "--json"]),
        Soaked("jog", ["jog", str(path), "--source", "script", "--script", str(folder / "script.txt"), "--json"]),
        Soaked("campaign", ["campaign", str(folder / "campaign.toml"), "--out", "out", "--workers", "1"], True),
    ]


def soak(seconds: float, every_s: float, warm_up_s: float, out: Path | None) -> dict[str, Any]:
    """Run all for `seconds`; what became of each. `out` is written with every tenth sample."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        all_ = commands(folder, seconds)
        page: Page | None = None
        for one in all_:
            one.begin(folder)
            time.sleep(8.0)
        began, count = time.monotonic(), 0
        try:
            while time.monotonic() - began < seconds:
                time.sleep(every_s)
                page = _page(folder, page)
                for one in all_:
                    assert one.process is not None
                    if one.process.poll() is not None:
                        one.ends.append(_last_words(folder, one))
                        if one.name == "run":
                            _reset(folder)
                        one.begin(folder)
                    one.sample()
                count += 1
                if count % 10 == 0:
                    _tell(_document(all_, time.monotonic() - began, warm_up_s), out)
        finally:
            _end([one.process for one in reversed(all_)])
            if page is not None:
                page.kill()
                page.wait()
        found = _document(all_, time.monotonic() - began, warm_up_s)
        _tell(found, out)
        return found


def _page(folder: Path, page: Page | None) -> Page | None:
    """A page of the cockpit that is open, once there is an address."""
    if page is not None and page.poll() is None:
        return page
    said = (folder / "cockpit.out").read_text()
    if not said.strip():
        return None
    return Page(json.loads(said)["watch_only"])


def _reset(folder: Path) -> None:
    """Acknowledge the fault that a drive latches whose controller was held up."""
    words = [*CAPSULE, "run", "deployment.toml", "reset", "--log", "reset.blf"]
    subprocess.run(words, cwd=folder, env=ENVIRONMENT, capture_output=True, check=False)


def _last_words(folder: Path, one: Soaked) -> str:
    said = (folder / f"{one.name}.out").read_text().strip()
    try:
        return str(json.loads(said)["ended"])
    except (ValueError, KeyError, TypeError):
        return ((folder / f"{one.name}.err").read_text().strip().splitlines() or ["nothing said"])[-1][-200:]


def _end(processes: Sequence[subprocess.Popen[bytes] | None]) -> None:
    for process in processes:
        if process is None or process.poll() is not None:
            continue
        process.send_signal(signal.SIGINT)
        try:
            process.wait(_ENDS_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _document(all_: Sequence[Soaked], took_s: float, warm_up_s: float) -> dict[str, Any]:
    found = {one.name: one.growth(warm_up_s) for one in all_}
    flat = all(one["growth_MB_h"] is not None and one["growth_MB_h"] <= BOUND_MB_H for one in found.values())
    return {
        "seconds": round(took_s),
        "warm_up_s": warm_up_s,
        "bound_MB_h": BOUND_MB_H,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "flat": flat,
        "commands": found,
    }


def _tell(found: dict[str, Any], out: Path | None) -> None:
    if out is not None:
        out.write_text(json.dumps(found) + "\n")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--every", type=float, default=5.0, help="s between samples")
    parser.add_argument("--warm-up", type=float, default=300.0, help="s of each life that do not count")
    parser.add_argument("--out", type=Path, default=None, help="a JSON file, written as the time goes on")
    asked = parser.parse_args()
    found = soak(asked.seconds, asked.every, asked.warm_up, asked.out)
    print(f"{found['seconds']} s, {found['cores']} cores, Python {found['python']}; at most {BOUND_MB_H:g} MB/h")
    for name, one in found["commands"].items():
        grew = "not measured" if one["growth_MB_h"] is None else f"{one['growth_MB_h']:+8.2f} MB/h"
        begun = f"; begun {one['lives']} times: {'; '.join(sorted(set(one['ends'])))}" if one["ends"] else ""
        held = f"{one['MB'] or 0:.0f} MB at the end, {one['most_MB'] or 0:.0f} at most"
        print(f"{name:9s} {grew}, {one['samples']} samples, {held}{begun}")
    return 0 if found["flat"] else 1


if __name__ == "__main__":
    sys.exit(main())
