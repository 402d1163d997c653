"""Whether what is said with p comes true with p, and how often each verdict is right: simulated series of all kinds.

`python -m tests.bench.bench_calibration --out DIR [--count 300] [--seconds 45] [--workers 2]` draws so many series
(kinds in turn; a third without an effect, the others with one of the plant's, of which one in six is nothing the
catalogue has; clean, usual or poor instruments), runs `capsule campaign` over them and prints the tables that
docs/results quote. A series is known by its number and kind, so a larger count adds series, the same command goes on
after a kill, and tables, map and diagram are of every kind on file; `--table` only prints what is on file, `--fit
MAP.toml` fits the map from score to probability to it, `--diagram FILE.svg` draws the reliability diagram. `--rows
FILE.jsonl` keeps a line a series that outlives DIR: those in it are not run again, those that ended are added. The
hidden effects' forms are the plant's own.

What is judged: every effect that a report lists, said with its score, is right where the hidden effect stands in
its class. `none` is right where nothing is hidden, `named` where the hidden effect stands in the only class, `unknown`
where the hidden effect is nothing that the catalogue has. An effect too small to be seen counts like any other.
"""

import argparse
import contextlib
import datetime
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import groupby, pairwise
from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.optimize import isotonic_regression

from hil.app.main import run as capsule
from hil.log.recorder import code_version
from models.identification.confidence_map import MAP, ConfidenceMap
from models.identification.settings import SET
from plant.experiments.examples import BELIEVED
from plant.hidden.registry import HIDDEN
from tests.bench.bench_tracing import EFFECTS
from tests.plant.axis_series import BENCHES, make_axis_series
from tests.plant.series import answer_of, make_series, published

AXIS: Final = "axis"
KINDS: Final = (*EFFECTS, AXIS)
NONE_SHARE: Final = 1 / 3
OUTSIDE_SHARE: Final = 1 / 6
EDGES: Final = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)
POOL: Final = 10
FOLDS: Final = 5
INSTRUMENTS: Final = {"clean": (0.3, 500.0), "usual": (1.0, 500.0), "poor": (5.0, 100.0)}
"""Times the usual noise (1 mN, 50 um), and samples a second."""


@dataclass(frozen=True)
class Drawn:
    """One series to be made."""

    number: int
    kind: str
    effect: str | None
    instrument: str

    @property
    def name(self) -> str:
        """Its folder's."""
        return f"{self.number:04d}_{self.kind}_{self.instrument}"


@dataclass(frozen=True)
class Statement:
    """What was said with the score `p`, and whether it was right."""

    p: float
    right: bool


def candidates(kind: str) -> tuple[Sequence[str], Sequence[str]]:
    """What may hide on a rig of `kind`: what the catalogue has, and what it has not."""
    if kind == AXIS:
        return [name for name in BENCHES if published(name)], [name for name in BENCHES if not published(name)]
    outside = [e.id for e in HIDDEN if not published(e.id) and BELIEVED[kind].kind in e.drives]
    return EFFECTS[kind], [] if kind == "vibro_plate" else outside


def drawn(number: int, seed: int, kinds: Sequence[str]) -> Drawn:
    """Series `number` of the draw `seed`, the same whatever the count is."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(number,)))
    kind = kinds[number % len(kinds)]
    instrument = tuple(INSTRUMENTS)[int(rng.integers(len(INSTRUMENTS)))]
    absent, without = rng.random(2)
    within, outside = candidates(kind)
    some = outside if outside and without < OUTSIDE_SHARE else within
    effect = None if absent < NONE_SHARE else str(rng.choice(some))
    return Drawn(number, kind, effect, instrument)


def made(series: Drawn, seed: int, seconds: float, folder: Path) -> None:
    """Its files, where they are not there yet."""
    if not (folder / series.name / "answer.toml").exists():
        noise, rate = INSTRUMENTS[series.instrument]
        own = int(np.random.SeedSequence(seed, spawn_key=(series.number, 1)).generate_state(1)[0])
        if series.kind == AXIS:
            make_axis_series(series.effect, own, folder / series.name, seconds, noise, rate)
        else:
            make_series(series.kind, series.effect, own, folder / series.name, seconds, noise, rate)


def kept_rows(path: Path | None, seed: int, seconds: float) -> dict[str, dict[str, Any]]:
    """Results by the series' names that `path` keeps of the draw `seed` with records of `seconds`."""
    lines = path.read_text(encoding="utf-8").splitlines() if path is not None and path.exists() else []
    rows = [json.loads(line) for line in lines]
    return {row["series"]: row["result"] for row in rows if (row["seed"], row["seconds"]) == (seed, seconds)}


def keep_rows(path: Path, seed: int, seconds: float, ended: Mapping[str, dict[str, Any]]) -> None:
    """Add what `ended` to `path`, whatever is there already."""
    before = kept_rows(path, seed, seconds)
    told = ("id", "equivalent", "confidence_score")
    with path.open("a", encoding="utf-8") as file:
        for name in sorted(ended.keys() - before.keys()):
            one = ended[name]
            effects = [{key: effect[key] for key in told} for effect in one["effects"]]
            result = {"verdict": one["verdict"], "effects": effects, "seconds": one["seconds"]}
            row = {"seed": seed, "seconds": seconds, "series": name, "code": code_version(), "result": result}
            file.write(json.dumps(row) + "\n")


def isotonic(said: Sequence[Statement], series: int, date: str) -> ConfidenceMap:
    """The map from score to the share that was right, never falling: pools of an isotonic regression over the scores,
    each of at least `POOL` statements (k of n right: Laplace's (k + 1)/(n + 2)) and a knot at its mean score.
    """
    ties = [list(same) for _, same in groupby(sorted(said, key=attrgetter("p")), key=attrgetter("p"))]
    fit = isotonic_regression([_share(same) for same in ties], weights=[*map(len, ties)])
    pools: list[list[Statement]] = []
    for begin, end in pairwise(fit.blocks):
        own = [one for same in ties[begin:end] for one in same]
        if pools and len(pools[-1]) < POOL:
            pools[-1] += own
        else:
            pools.append(own)
    if len(pools) > 1 and len(pools[-1]) < POOL:
        last = pools.pop()
        pools[-1] += last
    score = [float(np.mean([s.p for s in pool])) for pool in pools]
    right = np.maximum.accumulate([(sum(s.right for s in pool) + 1) / (len(pool) + 2) for pool in pools])
    return ConfidenceMap(series, len(said), date, tuple(score), tuple(float(r) for r in right))


def map_toml(fitted: ConfidenceMap) -> str:
    """As a file that `read_map` reads."""
    head = "".join(line for line in MAP.read_text(encoding="utf-8").splitlines(keepends=True) if line[:1] == "#")
    rows = {name: ", ".join(f"{v:.4g}" for v in getattr(fitted, name)) for name in ("score", "right")}
    return (
        f'{head}series = {fitted.series}\nstatements = {fitted.statements}\ndate = "{fitted.date}"\n'
        f"score = [{rows['score']}]\nright = [{rows['right']}]\n"
    )


def cross_validated(said: Sequence[Statement], series: int) -> list[Statement]:
    """Each statement with the probability of a map that was fitted to the other four fifths."""
    out = []
    for fold in range(FOLDS):
        made = isotonic([s for i, s in enumerate(said) if i % FOLDS != fold], max(series, SET.calibrated_on), "")
        out += [Statement(made.probability(s.p), s.right) for i, s in enumerate(said) if i % FOLDS == fold]
    return out


def expected_calibration_error(said: Sequence[Statement]) -> float:
    """Mean over the bins between `EDGES` of how far the share that was right is from the mean p, by their sizes."""
    return sum(len(b) * abs(_share(b) - float(np.mean([s.p for s in b]))) for _, b in _bins(said)) / len(said)


def interval(right: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z2 = 1.96**2
    centre = (right + z2 / 2) / (count + z2)
    half = np.sqrt(z2 * (right * (count - right) / count + z2 / 4)) / (count + z2)
    return float(centre - half), float(centre + half)


def statements(result: dict[str, Any], effect: str | None) -> list[Statement]:
    """Every effect that a report lists, with its score."""
    answer = None if effect is None or not published(effect) else answer_of(effect)
    return [Statement(e["confidence_score"], answer in (e["id"], *e["equivalent"])) for e in result["effects"]]


def verdict_right(result: dict[str, Any], effect: str | None) -> bool:
    """Whether the verdict is the one that it should be."""
    if effect is None:
        return bool(result["verdict"] == "none")
    if not published(effect):
        return bool(result["verdict"] == "unknown")
    said = statements(result, effect)
    return result["verdict"] == "named" and len(said) == 1 and said[0].right


def tables(rows: Sequence[tuple[Drawn, dict[str, Any]]]) -> str:
    """The tables as Markdown."""
    said = [s for series, result in rows for s in statements(result, series.effect)]
    lines = [
        "| said with p | mean p | effects said | right | share right, 95 % interval |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, part in _bins(said):
        low, high = interval(sum(s.right for s in part), len(part))
        mean = float(np.mean([s.p for s in part]))
        lines.append(
            f"| {name} | {mean:.3f} | {len(part)} | {sum(s.right for s in part)} | {_share(part):.2f}, {low:.2f} to"
            f" {high:.2f} |"
        )
    error = f"{expected_calibration_error(said):.3f}" if said else "-"
    lines += [
        "",
        f"Expected calibration error {error} over {len(said)} effects said.",
        "",
    ]
    lines += [
        "| verdict | series | nothing hidden | hidden, right class | hidden, wrong class | not in the catalogue |"
    ]
    lines += ["| --- | --- | --- | --- | --- | --- |"]
    for verdict in ("none", "named", "unknown"):
        ended = [(s, r) for s, r in rows if r["verdict"] == verdict]
        lines.append(f"| {verdict} | {len(ended)} | " + " | ".join(map(str, _kinds_of_truth(ended))) + " |")
    lines += ["", *(_right(f"{verdict} is right", rows, verdict) for verdict in ("none", "named", "unknown"))]
    for what in ("kind", "instrument"):
        for value in dict.fromkeys(getattr(series, what) for series, _ in rows):
            lines.append(_right(f"{what} {value}", [(s, r) for s, r in rows if getattr(s, what) == value]))
    lines.append(_right("all", rows))
    return "\n".join(lines)


def diagram(said: Sequence[Statement], series: int) -> str:
    """The reliability diagram as SVG: the share right over the mean p of each bin, with its 95 % interval and its
    number; on the diagonal p is the share.
    """
    side, left, top = 320.0, 56.0, 16.0
    text = 'font-family="sans-serif" font-size="12" fill="#333"'

    def at(p: float, share: float) -> tuple[float, float]:
        return left + side * p, top + side * (1 - share)

    parts = [
        '<svg xmlns="http://www.w3.org/2000/svg" width="400" height="400" viewBox="0 0 400 400">',
        '<rect width="400" height="400" fill="#fff"/>',
        f'<rect x="{left}" y="{top}" width="{side}" height="{side}" fill="none" stroke="#999"/>',
        f'<path d="M{left} {top + side}L{left + side} {top}" stroke="#999" stroke-dasharray="4 4"/>',
    ]
    for value in (0.0, 0.25, 0.5, 0.75, 1.0):
        (x, _), (_, y) = at(value, 0), at(0, value)
        parts.append(f'<text x="{x}" y="{top + side + 16}" text-anchor="middle" {text}>{value:g}</text>')
        parts.append(f'<text x="{left - 6}" y="{y + 4}" text-anchor="end" {text}>{value:g}</text>')
    for _, part in _bins(said):
        p, share = float(np.mean([s.p for s in part])), _share(part)
        low, high = interval(sum(s.right for s in part), len(part))
        (x, y), (_, y_low), (_, y_high) = at(p, share), at(p, low), at(p, high)
        parts.append(f'<path d="M{x:.1f} {y_low:.1f}V{y_high:.1f}" stroke="#2b6cb0" stroke-width="2"/>')
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="#2b6cb0"/>')
        parts.append(f'<text x="{x:.1f}" y="{y_low + 14:.1f}" text-anchor="middle" {text}>{len(part)}</text>')
    middle = left + side / 2
    said_of = f"said with p ({len(said)} effects in {series} series)"
    parts.append(f'<text x="{middle}" y="{top + side + 38}" text-anchor="middle" {text}>{said_of}</text>')
    turned = f'transform="rotate(-90 14 {top + side / 2})"'
    parts.append(f'<text x="14" y="{top + side / 2}" text-anchor="middle" {turned} {text}>share that was right</text>')
    return "\n".join([*parts, "</svg>", ""])


def _right(name: str, rows: Sequence[tuple[Drawn, dict[str, Any]]], verdict: str | None = None) -> str:
    right = [verdict_right(r, s.effect) for s, r in rows if verdict in (None, r["verdict"])]
    return f"- {name}: {sum(right)} of {len(right)}"


def _kinds_of_truth(rows: Iterable[tuple[Drawn, dict[str, Any]]]) -> list[int]:
    counts = [0, 0, 0, 0]
    for series, result in rows:
        if series.effect is None:
            counts[0] += 1
        elif not published(series.effect):
            counts[3] += 1
        else:
            counts[1 if any(s.right for s in statements(result, series.effect)) else 2] += 1
    return counts


def _bins(said: Sequence[Statement]) -> list[tuple[str, list[Statement]]]:
    parts = []
    for low, high in pairwise(EDGES):
        inside = [s for s in said if low < s.p <= high]
        if inside:
            parts.append((f"{low:g} to {high:g}", inside))
    return parts


def _share(said: Sequence[Statement]) -> float:
    return sum(s.right for s in said) / len(said)


def main() -> None:
    """Make and close what is missing, then print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seconds", type=float, default=45.0, help="length of a record")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--kind", nargs="*", choices=KINDS, default=list(KINDS))
    parser.add_argument("--fit", type=Path, metavar="MAP.toml", help="fit the map to what is on file, and write it")
    parser.add_argument("--diagram", type=Path, metavar="FILE.svg", help="draw the reliability diagram")
    parser.add_argument("--rows", type=Path, metavar="FILE.jsonl", help="keep a line a series, and go on from them")
    parser.add_argument("--table", action="store_true", help="only print what is on file")
    asked = parser.parse_args()
    wanted = {s.name: s for s in (drawn(number, asked.seed, asked.kind) for number in range(asked.count))}
    known = kept_rows(asked.rows, asked.seed, asked.seconds)
    folder, campaign = asked.out / "series", asked.out / f"campaign_{len(known)}"
    missing = {name: series for name, series in wanted.items() if name not in known}
    if missing and not asked.table:
        with ProcessPoolExecutor(asked.workers) as pool:
            for _ in pool.map(partial(made, seed=asked.seed, seconds=asked.seconds, folder=folder), missing.values()):
                pass
        folders = [str(folder / name) for name in missing]
        with contextlib.redirect_stdout(io.StringIO()):
            capsule(["campaign", *folders, "--out", str(campaign), "--workers", str(asked.workers), "--json"])
    results = campaign / "results.jsonl"
    lines = results.read_text(encoding="utf-8").splitlines()[1:] if results.exists() else []
    ended = {row["point"]["series"]: row for row in map(json.loads, lines)}
    found = {name: row["result"] for name, row in ended.items() if "result" in row} | known
    if asked.rows is not None:
        keep_rows(asked.rows, asked.seed, asked.seconds, found)
    wanted = {name: drawn(int(name[:4]), asked.seed, (name[5:].rpartition("_")[0],)) for name in found} | wanted
    told = [(series, found[name]) for name, series in wanted.items() if name in found]
    for name, series in wanted.items():
        result = found.get(name)
        if result is not None:
            mark = "right" if verdict_right(result, series.effect) else "WRONG"
            named = {
                " or ".join([e["id"], *e["equivalent"]]): round(e["confidence_score"], 3) for e in result["effects"]
            }
            print(f"{name:26} {series.effect!s:22} {mark} {result['verdict']:8} {named} {result['seconds']:.0f} s")
        elif name in ended:
            print(f"{name:26} {series.effect!s:22} refused: {ended[name]['error']}")
    said = [s for series, result in told for s in statements(result, series.effect)]
    if asked.diagram is not None:
        asked.diagram.write_text(diagram(said, len(told)), encoding="utf-8")
    if asked.fit is not None:
        fitted = isotonic(said, len(told), datetime.date.today().isoformat())
        asked.fit.write_text(map_toml(fitted), encoding="utf-8")
        error = expected_calibration_error(cross_validated(said, len(told)))
        print(f"{asked.fit}: {len(fitted.score)} knots; expected calibration error {error:.3f} (cross-validated)")
    print(f"\n{len(told)} of {len(wanted)} series of {asked.seconds:g} s a record\n\n{tables(told)}")


if __name__ == "__main__":
    main()
