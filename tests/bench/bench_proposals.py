"""Ten hidden effects outside the catalogue: does the proposed form, tried as an own effect, halve the held-out error?

`python -m tests.bench.bench_proposals [NAME...]`. The calibrated model stands for a search that named nothing;
`residual` is the form that follows the residual's curve, `inside` the one that follows the spline in the simulation.
"""

import json
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from hil.app.effects import effect_text
from models.effects import Catalogue
from models.effects.effect import Effect, Signals, Values, number
from models.effects.own import Origin, own_effects
from models.identification.finding import Dependence
from models.identification.fitting.fitter import Fitter
from models.identification.inner_spline import followed_inside
from models.identification.kinds import kind_for
from models.identification.kinds.reports import AnyKind
from models.identification.residual_dependence import dependence_of
from models.identification.search.fitted_model import FittedModel
from models.identification.search.search import Search
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.words.quantities import plain
from tests.rig_texts import GUT

PULL = parse_rig(tomllib.loads(f'{GUT}\n[rig]\nkind = "pull"\n[noise]\nforce_std_N = 1e-3\n'))
AXIS = parse_rig(
    {
        "rig": {"kind": "axis"},
        "axis": {"mass_kg": 10.0, "viscous_friction_N_s_per_m": 20.0, "coulomb_friction_N": 8.0, "offset_N": 0.0},
        "noise": {"force_std_N": 0.3},
    }
)
Law = Callable[[Signals], Any]
HIDDEN: dict[str, tuple[Rig, str, Law]] = {
    "axis: end springs": (AXIS, "force", lambda s: -200 * (np.maximum(s.x - 0.04, 0) + np.minimum(s.x + 0.03, 0))),
    "axis: a push at one place": (AXIS, "force", lambda s: 6 / (1 + ((s.x - 0.015) / 0.006) ** 2)),
    "axis: drag that sets in": (AXIS, "level", lambda s: 1 + 1.2 / (1 + (0.08 / np.maximum(np.abs(s.v), 1e-6)) ** 4)),
    "axis: warming as a hyperbola": (AXIS, "level", lambda s: 1 - 0.4 * s.t / (s.t + 3)),
    "axis: a skew hump over the place": (
        AXIS,
        "level",
        lambda s: 1 + 60 * np.maximum(s.x + 0.05, 0) * np.exp(-np.maximum(s.x + 0.05, 0) / 0.02),
    ),
    "pull: two humps over the place": (
        PULL,
        "level",
        lambda s: 1 + 0.3 / (1 + ((s.x - 3e-3) / 1e-3) ** 2) + 0.15 / (1 + ((s.x - 7e-3) / 1e-3) ** 2),
    ),
    "pull: a load that comes": (PULL, "force", lambda s: -0.01 / (1 + (8.0 / np.maximum(s.t, 1e-3)) ** 6)),
    "pull: a hump over the way": (PULL, "level", lambda s: 1 + 0.25 / (1 + ((s.travelled - 0.02) / 6e-3) ** 2)),
    "pull: a hump over the speed": (PULL, "level", lambda s: 1 + 0.3 / (1 + ((np.abs(s.v) - 4e-3) / 1.5e-3) ** 2)),
    "pull: a spring that hardens": (PULL, "force", lambda s: -0.02 * (s.x / 8e-3) ** 3),
}


def hidden_effect(kind: str, hook: str, law: Law) -> type[Effect]:
    def acts(self: Effect, s: Signals, p: Values, z: Values) -> Any:
        return law(s)

    space = {"id": "hidden", "kinds": frozenset({kind}), "size": number(1.0, "1", 0.0, 2.0, fit=False), hook: acts}
    return type("Hidden", (Effect,), space)


def with_own(kind: AnyKind, *origins: Origin) -> AnyKind:
    catalogue = Catalogue((*kind.catalogue.own, *origins))
    more: AnyKind = replace(kind, effects=(*kind.effects, *(o.effect for o in origins)), catalogue=catalogue)
    return more


def series(rig: Rig, seed: int) -> Iterator[Record]:
    """Three motions to train on and one held out, of sums of waves."""
    rng, turns = np.random.default_rng(seed), rig.kind == "axis"
    t = np.arange(0, 16, 1e-2 if turns else 2e-3)
    for name in ("one", "two", "three", "held"):
        rows = zip((0.04, 0.015, 0.01) if turns else (2.5e-3, 1.5e-3, 1e-3), rng.uniform(0.05, 0.45, 3), strict=True)
        phases = rng.uniform(0, 2 * np.pi, 3) if turns else np.zeros(3)
        waves = zip(rows, phases, strict=True)
        x = np.sum([a * (np.sin if turns else _raised)(2 * np.pi * f * t + at) for (a, f), at in waves], axis=0)
        yield Record(name, rig.kind, {"t_s": t, "position_m": x, "force_N": np.zeros_like(t)})


def _raised(phase: Any) -> Any:
    return 1 - np.cos(phase)


def tried(kind: AnyKind, train: list[Record], held: Record, base: Any, found: Dependence) -> float:
    """The held-out error with the proposed term of `found` as an own effect."""
    report = plain({"verdict": "unknown", "kind": kind.name, "residual": asdict(found)})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "proposed.py"
        path.write_text(effect_text(report, "proposed", "report"))
        (origin,) = own_effects([path], {})
        own, effect = with_own(kind, origin), origin.effect
        fitter = Fitter.of(own, train, ["proposed"])
        sizes = (0.3, 1.0)
        size = effect.amplitude()
        term = found.term
        assert term is not None
        amount = term.amplitude.value / (term.level if term.along == "-v" else 1.0)
        starts = [base.with_("proposed", effect.start() | {size.name: share * amount}) for share in sizes]
        fit = fitter.exactly(fitter.far(starts, seeds=1).theta)
        return float(own.error([held], [own.predict(held, fit.theta)]))


def one(name: str) -> dict[str, Any]:
    rig, hook, law = HIDDEN[name]
    blanks = list(series(rig, 1 + [*HIDDEN].index(name)))
    blank = kind_for(rig, blanks)
    noisy = blank if rig is AXIS else replace(blank, noise_std=1e-3)
    true = with_own(noisy, Origin(hidden_effect(rig.kind, hook, law), "", ""))
    rng = np.random.default_rng(0)
    truth = blank.nominal().with_("hidden", {"size": 1.0})
    *train, held = [true.imitate(record, truth, rng) for record in blanks]
    kind, began = kind_for(rig, train), time.process_time()
    fitter = Fitter.of(kind, train, [])
    base = fitter.exactly(fitter.far([kind.nominal()]).theta)
    splits = kind.splits(kind.searched(train))
    model = FittedModel(kind, splits).near([base.theta] * len(splits))
    found = Search(base, base, parts=[(1 / len(splits), theta) for theta in model.thetas])
    residual = dependence_of(kind, train, base.theta)
    row: dict[str, Any] = {"name": name, "before": kind.error([held], [kind.predict(held, base.theta)])}
    row["floor"] = kind.noise_floor([held])
    assert residual is not None
    inside = followed_inside(kind, found, train, residual)
    for key, dependence in (("residual", residual), ("inside", inside)):
        term = dependence.term
        if term is None:
            row[key] = row["before"]
            continue
        row[key] = tried(kind, train, held, base.theta, dependence)
        row[f"{key}_term"] = f"{term.form} over {term.variable} {term.along}"
    return row | {"costs": inside.inside, "s": time.process_time() - began}


if __name__ == "__main__":
    for wanted in sys.argv[1:] or HIDDEN:
        print(json.dumps(one(wanted)), flush=True)
