"""What the report says about a table of friction: its law, what the table cannot tell, what to measure next."""

from collections.abc import Mapping, Sequence

import numpy as np

from models.effects.equation import lines_of
from models.formula import Line, equal, symbols
from models.identification.kinds.friction import FORCE, SPEED, FrictionKind, cannot_show
from models.records.record import Record
from models.rigs.benches import FRICTION
from models.theta import Theta


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
    """Sentences on how the noise is known, on where the friction is least, and on what the table cannot show."""
    repeats = sum(len(r) - len(kind.conditions(r)[0]) for r in records)
    if kind.std is not None:
        noise = f"A reading's standard deviation is {kind.std:.3g} N, as stated."
    else:
        how = "from its repeats" if repeats >= 3 else "from neighbouring speeds, for want of repeats"
        noise = f"A reading's standard deviation is {100 * kind.relative:.2g} % of it, {how}."
    lacking = cannot_show(kind.extent, kind.catalogue) if kind.extent is not None else {}
    told = [f"These records cannot show {effect}: {why}." for effect, why in lacking.items()]
    return [noise, *_least(kind, theta_by_stage, records), *told]


def _least(kind: FrictionKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Where the augmented model has its least friction between the slowest and the fastest speed, if within them."""
    theta, x = theta_by_stage.get("augmented"), kind.extent
    if theta is None or x is None or x.fast <= x.slow:
        return []
    v = np.geomspace(x.slow, x.fast, 200)
    usual = float(np.median(np.concatenate([kind.conditions(r)[0][:, 1] for r in records])))
    curve = Record("curve", FRICTION.id, {SPEED: v, "load_N": np.full(len(v), usual), kind.quantity: np.ones(len(v))})
    friction = kind.predict(curve, theta)
    k = int(np.argmin(friction))
    if not 0 < k < len(v) - 1:
        return []
    return [
        f"Friction is least at {v[k]:.3g} m/s, {friction[k]:.3g} {kind.unit if kind.unit != '1' else ''}".strip() + "."
    ]


def next_experiment(kind: FrictionKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What the table lacks most: speeds, loads, the other direction, repeats; None where it has them all."""
    x = kind.extent
    if x is None:
        return None
    lacks, wanted = x.lacks, list[str]()
    if "speeds" in lacks:
        wanted.append(f"ten speeds from {x.slow / 10:.2g} to {x.fast * 10:.2g} m/s")
    if "load" in lacks:
        wanted.append(f"the same speeds under loads of {x.light / 3:.2g} and {x.heavy * 3:.2g} N")
    if "both_ways" in lacks:
        wanted.append("the same backwards")
    if all(len(r) == len(kind.conditions(r)[0]) for r in records):
        wanted.append("each condition three times")
    return "measure " + ", ".join(wanted) if wanted else None
