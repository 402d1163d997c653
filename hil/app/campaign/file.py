"""CAMPAIGN.toml: a closed loop run many times, over drawn anatomies and rigs, hidden effects, faults and controllers.

[campaign]
engine = "track"                                # or "sil": over the bus
scenario = "track_magnetic_ramp.toml"           # beside this file
cases = 100                                     # each with a seed and draws of its own
[draw."tissue.friction_coefficient"]            # a key of the scenario
uniform = [0.06, 0.11]                          # or log_uniform, choice, integer
[grid]                                          # every case under every combination
"control.controller" = ["pid", "mpc"]
[[variants.hidden]]                             # more of the grid: tables that are laid over the scenario
name = "folds"
set.effects.fold_periodic = { excess = 0.3, wavelength_m = 0.0073 }
"""

import hashlib
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np

from hil.app.campaign.worker import LONGEST_S, Loop, Table
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.scenario.scenario import parse_track_scenario
from hil.app.track.score import Score
from models.files.toml import LARGEST_INTEGER, check_known, check_tables, in_file, read_toml
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.rigs import schema
from models.rigs.schema import Among, NamedTable
from models.theta import Theta

Distribution = tuple[str, tuple[Any, ...]]


def distribution(key: str, table: Any) -> Distribution:
    if isinstance(table, dict) and any(isinstance(value, dict) for value in table.values()):
        raise ValueError(f'draw must have its keys in quotes, as [draw."{key}.{next(iter(table))}"]; got them without')
    if not isinstance(table, dict) or len(table) != 1:
        raise ValueError(f'draw."{key}" must have one of {", ".join(_DRAWS)}; got {table!r}')
    kind, numbers = next(iter(table.items()))
    check_known([kind], _DRAWS, f'draw."{key}" must have one of')
    if not isinstance(numbers, list) or not numbers:
        raise ValueError(f'draw."{key}" {kind} must be a list; got {numbers!r}')
    whole, most = kind == "integer", _MOST_INTEGER if kind == "integer" else _MOST
    known = all(isinstance(n, int if whole else int | float) and not isinstance(n, bool) for n in numbers)
    bounds = known and len(numbers) == 2 and -most < numbers[0] <= numbers[1] < most
    if kind != "choice" and not (bounds and (kind != "log_uniform" or numbers[0] > 0)):
        own = {"integer": "integers of at most 15 digits", "log_uniform": "positive numbers"}
        what = own.get(kind, "finite numbers")
        raise ValueError(f'draw."{key}" {kind} must be [lower, upper], {what}; got {numbers!r}')
    return kind, tuple(numbers)


_MOST: Final = 1e300  # what a drawn number may be
_MOST_INTEGER: Final = 10**15  # the same of an integer
_DRAWS: Final[Mapping[str, Callable[[np.random.Generator, tuple[Any, ...]], Any]]] = {
    "uniform": lambda rng, n: float(rng.uniform(n[0], n[1])),
    "log_uniform": lambda rng, n: float(math.exp(rng.uniform(math.log(n[0]), math.log(n[1])))),
    "integer": lambda rng, n: int(rng.integers(n[0], n[1] + 1)),
    "choice": lambda rng, n: n[int(rng.integers(len(n)))],
}


TABLES: Final = ("campaign", "draw", "grid", "variants")
MOST_RUNS: Final = 1_000_000  # of a campaign
METRICS: Final = tuple(field.name for field in fields(Score) if field.type in (float, int))
ENGINES: Final[Mapping[str, Callable[[Table], Any]]] = {"track": parse_track_scenario, "sil": parse_sil_scenario}


class CampaignTable(NamedTable):
    """`[campaign]`."""

    where = "campaign"
    scenario: str = schema.key("the scenario, beside this file")
    engine: Annotated[str, Among(ENGINES)] = schema.key("`track`, or `sil`: over the bus", "track")
    cases: int = schema.key("cases, each with a seed and draws of its own", 1, 1, MOST_RUNS)
    seed: int = schema.key("sets every random number", 0, 0, LARGEST_INTEGER)
    chunk: int = schema.key("runs that go to a worker at once", 4, 1, 1000)
    limit_s: float = schema.key("longest time of a run; after it the run counts as failed", 3600.0, 0.1, LONGEST_S)
    metric: Annotated[str, Among(METRICS)] = schema.key(
        "what the report is about, a number of `track`", "tracking_rmse_m"
    )
    model: str = schema.key("a model that its controllers know, relative to this file", "")
    stage: Annotated[str, Among(STAGES)] = schema.key("which stage of it", "augmented")


@dataclass(frozen=True)
class Campaign:
    """All runs, computed on demand; those of one case share seed and draws, so controllers can be compared."""

    name: str
    head: CampaignTable
    raw: Table
    draws: Mapping[str, Distribution]
    combinations: Sequence[tuple[Table, Table]]
    values: Theta

    def __len__(self) -> int:
        return self.head.cases * len(self.combinations)

    def job(self, number: int) -> Loop:
        """Run `number`, from 0 on; the same whatever ran before it."""
        case, which = divmod(number, len(self.combinations))
        rng = np.random.default_rng(np.random.SeedSequence(self.head.seed, spawn_key=(case,)))
        seed = int(rng.integers(1 << 31))
        draws = {key: _DRAWS[kind](rng, numbers) for key, (kind, numbers) in self.draws.items()}
        over, point = self.combinations[which]
        raw = laid_over(self.raw, over)
        for key, value in draws.items():
            raw = laid_over(raw, nested(key, value))
        stage = self.head.stage if self.values else "nominal"
        return Loop(number, self.head.engine, raw, seed, {"case": case, **point, **draws}, self.values, stage)

    @property
    def fingerprint(self) -> str:
        """The hash of everything that the runs depend on, except the program."""
        head = self.head
        parts = [head.engine, head.cases, head.seed, head.stage, self.raw, self.draws, self.combinations, self.values]
        return hashlib.sha256(json.dumps(parts, sort_keys=True, default=dict).encode()).hexdigest()[:16]


def load_campaign(path: Path) -> Campaign:
    """Read and check a campaign file and its scenario; a ValueError of one sentence says what is wrong."""
    with in_file(path):
        raw, _ = read_toml(path, "campaign")
        check_tables(raw, TABLES)
        head = CampaignTable.read(raw)
        scenario, _ = read_toml(path.parent / head.scenario, "scenario")
        kind = str(_table(scenario, "rig").get("kind", ""))
        values = read_model(path.parent / head.model, kind).believed(head.stage) if head.model else Theta()
        draws = {key: distribution(key, value) for key, value in _table(raw, "draw").items()}
        grid, variants = _table(raw, "grid"), _table(raw, "variants")
        names = ["case", *draws, *grid, *variants]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ValueError(f"names in draw, grid and variants must differ, and none be 'case'; got {twice!r} twice")
        axes: list[list[tuple[Table, Table]]] = [[({}, {})], *_grid(grid), *_variants(variants)]
        runs = head.cases * math.prod(len(axis) for axis in axes)
        if runs > MOST_RUNS:
            raise ValueError(f"campaign must have at most {MOST_RUNS} runs; got {runs}")
        chosen = (zip(*choice, strict=True) for choice in itertools.product(*axes))
        combinations = [(reduce(laid_over, over), reduce(laid_over, point)) for over, point in chosen]
        campaign = Campaign(path.stem, head, scenario, draws, combinations, values)
        for which in range(min(len(combinations), 256)):
            tables = campaign.job(which).raw
            if "offer" in tables:
                raise ValueError(
                    "scenario of a campaign must have no [offer]; campaign.model is what its controllers know"
                )
            ENGINES[head.engine](tables)
    return campaign


def nested(key: str, value: Any) -> dict[str, Any]:
    """`a.b.c` and a value as tables within tables."""
    for part in reversed(key.split(".")):
        value = {part: value}
    return dict(value)


def laid_over(below: Table, above: Table) -> dict[str, Any]:
    """Tables merged key by key; anything else of `above` replaces what is `below`."""
    merged = dict(below)
    for key, value in above.items():
        before = merged.get(key)
        merged[key] = laid_over(before, value) if isinstance(before, Mapping) and isinstance(value, Mapping) else value
    return merged


def _grid(table: Table) -> list[list[tuple[Table, Table]]]:
    for key, choices in table.items():
        if isinstance(choices, dict):
            raise ValueError(
                f'grid must have its keys in quotes, as "{key}.{next(iter(choices), "")}" = [...]; got them without'
            )
        if not isinstance(choices, list) or not choices or any(choices.count(one) > 1 for one in choices):
            raise ValueError(f"grid.{key} must be a list of values that differ; got {choices!r}"[:200])
    return [[(nested(key, v), {key: v}) for v in choices] for key, choices in table.items()]


def _variants(table: Table) -> list[list[tuple[Table, Table]]]:
    axes: list[list[tuple[Table, Table]]] = []
    for axis, choices in table.items():
        names = [one.get("name") for one in choices if isinstance(one, dict)] if isinstance(choices, list) else []
        good = all(isinstance(name, str) and names.count(name) == 1 for name in names)
        if not names or len(names) != len(choices) or not good:
            must = f"variants.{axis} must be tables [[variants.{axis}]], each with a name of its own"
            raise ValueError(f"{must}; got {choices!r}"[:200])
        for one in choices:
            unknown = [key for key in one if key not in ("name", "set")]
            if unknown or not isinstance(one.get("set", {}), dict):
                got = (unknown or ["set"])[0]
                raise ValueError(f"variants.{axis} must have a name and tables under set; got {got!r}")
        axes.append([(one.get("set", {}), {axis: one["name"]}) for one in choices])
    return axes


def _table(raw: Table, name: str) -> Table:
    table = raw.get(name, {})
    if not isinstance(table, dict):
        raise ValueError(f"{name} must be a table; got {table!r}")
    return table
