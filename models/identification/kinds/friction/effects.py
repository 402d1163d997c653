"""The catalogue's effects on a steady contact, in ranges that follow from its records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.identification.kind import Array
from models.identification.kinds.ranges import Ranges, ranged
from models.identification.settings import SET
from models.rigs.friction import FRICTION


@dataclass(frozen=True)
class Extent:
    """Slowest and fastest speed in m/s, lowest and highest load, greatest friction in N, and both ways or not."""

    slow: float
    fast: float
    light: float
    heavy: float
    friction: float
    both_ways: bool

    @classmethod
    def of(cls, v: Array, load: Array, force: Array) -> Extent:
        """That of readings (n,) at speeds `v`."""
        fast, both = np.abs(v), bool((v > 0).any() and (v < 0).any())
        slow, quick, light, heavy = (float(end) for end in (fast.min(), fast.max(), load.min(), load.max()))
        return cls(slow, quick, light, heavy, float(np.abs(force).max()), both)

    @property
    def lacks(self) -> Mapping[str, str]:
        """What these records lack, by the name that an effect gives it in `needs`."""
        ratio = SET.friction_ratio
        told = {
            "speeds": (self.fast > ratio * self.slow, f"its speeds lie between {_span(self.slow, self.fast)} m/s"),
            "load": (self.heavy > ratio * self.light, f"its loads lie between {_span(self.light, self.heavy)} N"),
            "both_ways": (self.both_ways, "it slides one way only"),
        }
        return {name: words for name, (held, words) in told.items() if not held}


def _span(low: float, high: float) -> str:
    return f"{low:.3g} and {high:.3g}"


def candidates(extent: Extent | None, catalogue: Catalogue = CATALOGUE) -> tuple[type[Effect], ...]:
    """The effects that a search tries on a table of this extent; all of them, as declared, where it is not known."""
    declared = catalogue.acting_on(FRICTION.id)
    if extent is None:
        return declared
    told, known = _ranges(extent), extent.lacks.keys()
    return tuple(_ranged(e, told.get(e.id, Ranges())) for e in declared if not known & set(e.needs))


def cannot_show(extent: Extent, catalogue: Catalogue) -> dict[str, str]:
    """Why a table of this extent cannot show an effect, by the effect's id."""
    lacks = extent.lacks
    why = {e.id: "; ".join(lacks[need] for need in e.needs if need in lacks) for e in catalogue.acting_on(FRICTION.id)}
    return {name: words for name, words in why.items() if words}


def _ranges(x: Extent) -> Mapping[str, Ranges]:
    """Value and bounds of parameters that follow from the extent, and starts, by effect."""
    drag = 3 * x.friction * max(1.0, SET.drag_reference_m_s / x.fast) ** SET.drag_steepest
    return {
        "stribeck": Ranges(
            {"excess": (0.0, 0.0, 10.0), "speed_m_s": (float(np.sqrt(x.slow * x.fast)), 0.3 * x.slow, 3 * x.fast)},
            {"speed_m_s": tuple(float(v) for v in np.geomspace(x.slow, x.fast, 5))},
        ),
        "viscous_drag": Ranges(
            {"coefficient_N": (0.0, 0.0, drag), "exponent": (0.5, 0.1, SET.drag_steepest)},
            {"exponent": (0.2, 0.5, 1.0, 2.0)},
        ),
        "load_dependent_friction": Ranges({"growth_per_load": (0.0, -0.95 / x.heavy, 20 / x.heavy)}),
        "hertzian_contact": Ranges({"reference_N": (float(np.sqrt(x.light * x.heavy)), 1e-6, 1e9)}),
        "adhesive_contact": Ranges({"load_N": (0.0, -0.9 * x.light, 5 * x.heavy)}),
    }


def _ranged(effect: type[Effect], told: Ranges) -> type[Effect]:
    most = told.of[effect.amplitude().name][2] if effect.amplitude().name in told.of else effect.amplitude().upper
    return ranged(effect, replace(told, probe=min(effect.probe, 0.05 * most)))
