"""What an exported controller needs on a Cortex-M7, how it tracks in single precision, and whether any bits may come
in: `python -m tests.bench.bench_controller_export --out DIR [--ways WAY...] [--tick S] [--seeds N] [--ticks N]`, a
Markdown table; with `--pairs N` instead how single precision tracks beside double, over N seeds of each way.
"""

import argparse
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from hil.app.export.ticks import closed_loop
from hil.app.main import run
from hil.app.scenario.deployment import load_deployment
from tests.hil.app.export.native import led, native
from tests.hil.app.export.test_controller import counts, deployment
from tests.hil.app.export.tools import done, tool

CLOCKS_MHZ = (216, 480)
RUN_S = 10.0
PAIR_S = 5.0
WAYS = (
    *("feedforward", "feedforward --float32", "mpc", "mpc --float32", "coil", "coil --float32"),
    *("mpc --particles 100 --short-plan", "vibro"),
)
"""Controllers of the shipped deployment, feedforward of a coil, and an inner mass, with options of the export."""


def exported(
    out: Path, way: str, tick_s: float, duration_s: float = 5.0, *, believed: bool = False
) -> tuple[Path, Path]:
    """The deployment of a way and its exported folder; `believed`: its plant is its own rig as it is believed."""
    home = out / re.sub(r"\W+", "_", way)
    home.mkdir(parents=True, exist_ok=True)
    controller, *options = way.split()
    path = deployment(home, controller)
    text = re.sub(r"duration_s = [0-9.]+", f"duration_s = {duration_s:g}", path.read_text())
    text = text.replace("tick_s = 2e-3", f"tick_s = {tick_s:g}")
    text = text.replace("probe = true", "probe = false")
    path.write_text(text.partition("\n[plant]")[0] if believed else text)
    assert run(["export", "controller", str(path), "--out", str(home / "out"), *options]) == 0
    return path, home / "out"


def on_m7(folder: Path) -> list[str]:
    """Flash and RAM in KB, instructions of a tick, the highest rates, and the comparison with the log."""
    said = done([tool("make"), "m7"], folder, 3600.0)
    text, data, bss = map(int, re.findall(r"^\s*(\d+)\s+(\d+)\s+(\d+)\s+\d+\s+\w+\s+build/bare.elf", said, re.M)[0])
    stack = int(re.findall(r"stack (\d+)", said)[0])
    median, p99, most = map(int, re.findall(r"median (\d+), 99 of 100 (\d+), most (\d+)", said)[0])
    rates = [f"{1e6 * mhz / p99:.0f}, {1e6 * mhz / most:.0f}" for mhz in CLOCKS_MHZ]
    passed, failed = counts(said)
    sizes = [f"{(text + data) / 1024:.0f}", f"{(data + bss + stack) / 1024:.0f}"]
    return [
        *sizes,
        f"{median / 1e3:.0f}",
        f"{p99 / 1e3:.0f}",
        f"{most / 1e3:.0f}",
        *rates,
        f"{passed} of {passed + failed}",
    ]


def tracking(path: Path, folder: Path, seeds: int) -> str:
    """Tracking error in mm, rms, of the native node before the simulated plant: mean and range over seeds."""
    scenario, node = closed_loop(load_deployment(path), path), native(folder)
    found = []
    for seed in range(1, seeds + 1):
        ended = led(node, replace(scenario, loop=replace(scenario.loop, seed=seed)), RUN_S)
        assert not ended.reason, ended
        found.append(1e3 * ended.tracking_rmse_m)
    return f"{np.mean(found):.3f} ({min(found):.3f} to {max(found):.3f})"


def paired(out: Path, way: str, tick_s: float, seeds: int) -> str:
    """Tracking error (rms over 5 s) of the native node in single over that in double precision, on a plant as it is
    believed with the same noise for both: geometric mean over seeds and its 95 % interval.
    """
    (path, folder), (_, single) = (exported(out, one, tick_s, believed=True) for one in (way, f"{way} --float32"))
    scenario, nodes, ratios = closed_loop(load_deployment(path), path), (native(folder), native(single)), []
    for seed in range(1, seeds + 1):
        loop = replace(scenario, loop=replace(scenario.loop, seed=seed))
        double_m, single_m = (led(node, loop, PAIR_S).tracking_rmse_m for node in nodes)
        ratios.append(np.log(single_m / double_m))
    mean, half = np.mean(ratios), 1.96 * np.std(ratios, ddof=1) / np.sqrt(seeds)
    return f"{np.exp(mean):.3f} ({np.exp(mean - half):.3f} to {np.exp(mean + half):.3f})"


def fuzzed(folder: Path, cc: str, ticks: int) -> str:
    """What `make fuzz` of a folder says with a compiler."""
    (folder / "build" / "random_bits").unlink(missing_ok=True)
    said = done([tool("make"), "fuzz", f"CC={tool(cc)}", f"TICKS={ticks}"], folder, 7200.0)
    return said.strip().splitlines()[-1]


def rows(out: Path, ways: list[str], tick_s: float, seeds: int, ticks: int) -> Iterator[list[str]]:
    for way in ways:
        path, folder = exported(out, way, tick_s)
        row = [way, *on_m7(folder), tracking(path, folder, seeds) if seeds else ""]
        yield [*row, *([fuzzed(folder, cc, ticks) for cc in ("gcc", "clang")] if ticks else [])]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--ways", nargs="+", default=list(WAYS))
    parser.add_argument("--tick", type=float, default=2e-3, help="in s")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--ticks", type=int, default=0, help="of random bits under the sanitizers")
    parser.add_argument("--pairs", type=int, default=0, help="seeds of single beside double precision")
    args = parser.parse_args()
    if args.pairs:
        for way in args.ways:
            print(f"{way}: {paired(args.out, way, args.tick, args.pairs)}", flush=True)
        return
    columns = ["way", "flash KB", "RAM KB", "k instructions: median", "p99", "most"]
    columns += [f"Hz at {mhz} MHz by p99, most" for mhz in CLOCKS_MHZ]
    columns += ["ticks as in the log", "tracking mm", *(["gcc", "clang"] if args.ticks else [])]
    print(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}", flush=True)
    for row in rows(args.out, args.ways, args.tick, args.seeds, args.ticks):
        print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
