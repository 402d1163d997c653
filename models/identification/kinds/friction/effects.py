"""The catalogue's effects on a steady contact, in ranges that follow from its records."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect
from models.identification.kinds.variant import Range, variant
from models.identification.settings import SET
from models.parameter import Name, Parameter
from models.rigs.friction import FRICTION


@dataclass(frozen=True)
class Extent:
    """What a table covers: slowest and fastest speed in m/s, lowest and highest load and greatest friction in N, and
    whether both directions of sliding are in it.
    """

    slow: float
    fast: float
    light: float
    heavy: float
    friction: float
    both_ways: bool

    @property
    def lacks(self) -> Mapping[str, str]:
        """What these records lack, by the name that an effect gives it in `needs`."""
        told = {
            "speeds": ""
            if self.fast > SET.friction_ratio * self.slow
            else f"its speeds lie between {_span(self.slow, self.fast)} m/s",
            "load": ""
            if self.heavy > SET.friction_ratio * self.light
            else f"its loads lie between {_span(self.light, self.heavy)} N",
            "both_ways": "" if self.both_ways else "it slides one way only",
        }
        return {name: words for name, words in told.items() if words}


def _span(low: float, high: float) -> str:
    return f"{low:.3g} and {high:.3g}"


def candidates(extent: Extent | None, catalogue: Catalogue = CATALOGUE) -> tuple[type[Effect], ...]:
    """The effects that a search tries on a table of this extent; all of them, as declared, where it is not known."""
    declared = catalogue.acting_on(FRICTION.id)
    if extent is None:
        return declared
    ranges, grids = _ranges(extent), _grids(extent)
    return tuple(_ranged(e, ranges, grids) for e in declared if not extent.lacks.keys() & set(e.needs))


def cannot_show(extent: Extent, catalogue: Catalogue) -> dict[str, str]:
    """Why a table of this extent cannot show an effect, by the effect's id."""
    return {
        e.id: "; ".join(extent.lacks[need] for need in e.needs if need in extent.lacks)
        for e in catalogue.acting_on(FRICTION.id)
        if extent.lacks.keys() & set(e.needs)
    }


def _ranges(x: Extent) -> Mapping[Name, Range]:
    """Value and bounds of parameters that follow from the extent, by effect and parameter."""
    drag = 3 * x.friction * max(1.0, SET.drag_reference_m_s / x.fast) ** SET.drag_steepest
    return {
        ("stribeck", "excess"): (0.0, 0.0, 10.0),
        ("stribeck", "speed_m_s"): (float(np.sqrt(x.slow * x.fast)), 0.3 * x.slow, 3 * x.fast),
        ("viscous_drag", "coefficient_N"): (0.0, 0.0, drag),
        ("viscous_drag", "exponent"): (0.5, 0.1, SET.drag_steepest),
        ("load_dependent_friction", "growth_per_load"): (0.0, -0.95 / x.heavy, 20 / x.heavy),
        ("hertzian_contact", "reference_N"): (float(np.sqrt(x.light * x.heavy)), 1e-6, 1e9),
        ("adhesive_contact", "load_N"): (0.0, -0.9 * x.light, 5 * x.heavy),
    }


def _grids(x: Extent) -> Mapping[str, Mapping[str, tuple[float, ...]]]:
    return {
        "stribeck": {"speed_m_s": tuple(float(v) for v in np.geomspace(x.slow, x.fast, 5))},
        "viscous_drag": {"exponent": (0.2, 0.5, 1.0, 2.0)},
    }


def _ranged(
    effect: type[Effect], ranges: Mapping[Name, Range], grids: Mapping[str, Mapping[str, tuple[float, ...]]]
) -> type[Effect]:
    """The same law with other ranges."""
    parameters = tuple(_parameter(p, ranges.get((effect.id, p.name))) for p in effect.parameters())
    return variant(effect, parameters, grids.get(effect.id), min(effect.probe, 0.05 * parameters[0].upper))


def _parameter(p: Parameter, told: Range | None) -> Parameter:
    return p if told is None else replace(p, value=told[0], lower=told[1], upper=told[2])
