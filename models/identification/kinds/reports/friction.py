"""What the report says about a table of friction: its law, what the table cannot show, what to measure next."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from models.effects import effect_words
from models.effects.equation import lines_of
from models.formula import Line, equal, symbols
from models.identification.finding import Alike
from models.identification.kinds.friction import FORCE, LOAD, SPEED, FrictionKind, cannot_show
from models.records.record import Record
from models.rigs.benches import FRICTION
from models.theta import Theta
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)


def equations(kind: FrictionKind, theta: Theta) -> list[Line]:
    """The law, SI units: the base, then what each effect adds."""
    F, mu, N, v = symbols("F mu N v")
    values = kind.nominal() | theta
    if "friction_N" in values:
        base = equal(F, values["friction_N"] * np.sign(v))
    elif kind.quantity == FORCE:
        base = equal(F, values["friction_coefficient"] * N * np.sign(v))
    else:
        base = equal(mu, values["friction_coefficient"])
    return [[base], *lines_of(kind.effects, theta)]


def statements(kind: FrictionKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """On the noise, on the least friction, and on effects that the table cannot show."""
    repeats = sum(len(r) - len(kind.conditions(r)[0]) for r in records)
    if kind.std is not None:
        noise = TEXT("friction_stated", std=kind.std)
    else:
        noise = TEXT("friction_repeats" if repeats >= 3 else "friction_neighbours", share=kind.relative)
    lacking = cannot_show(kind.extent, kind.catalogue) if kind.extent is not None else {}
    words = {effect_words(effect, kind.catalogue): why for effect, why in lacking.items()}
    hidden = [TEXT("friction_cannot", effect=effect, why=why) for effect, why in words.items()]
    return [noise, *_least(kind, theta_by_stage, records), *hidden]


def _least(kind: FrictionKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Where the augmented model has its least friction, if between the slowest and the fastest speed."""
    theta, x = theta_by_stage.get("augmented"), kind.extent
    if theta is None or x is None or x.fast <= x.slow:
        return []
    v = np.geomspace(x.slow, x.fast, 200)
    usual = float(np.median(np.concatenate([kind.conditions(r)[0][:, 1] for r in records])))
    curve = Record("curve", FRICTION.id, {SPEED: v, LOAD: np.full(len(v), usual), kind.quantity: np.ones(len(v))})
    friction = kind.predict(curve, theta)
    k = int(np.argmin(friction))
    if not 0 < k < len(v) - 1:
        return []
    return [TEXT("friction_least", speed=float(v[k]), friction=Quantity(float(friction[k]), kind.unit))]


def next_experiment(kind: FrictionKind, theta: Theta, records: Sequence[Record], _: Alike) -> str | None:
    """What the table lacks most: speeds, loads, the other direction, repeats; None where it has them all."""
    x = kind.extent
    if x is None:
        return None
    wanted = {
        "speeds": TEXT("friction_speeds", low=x.slow / 10, high=x.fast * 10),
        "load": TEXT("friction_loads", light=x.light / 3, heavy=x.heavy * 3),
        "both_ways": TEXT("friction_backwards"),
        "repeats": TEXT("friction_thrice"),
    }
    repeats = any(len(r) > len(kind.conditions(r)[0]) for r in records)
    lacks = {*x.lacks, *(() if repeats else ("repeats",))}
    return TEXT("friction_measure", wanted=[wish for what, wish in wanted.items() if what in lacks]) if lacks else None
