"""The catalogue's effects on an axis: in a stage's units, in ranges that follow from its records, and about an axis."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import wraps
from inspect import signature
from typing import Any, Final

import numpy as np

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import HOOKS, Effect, by_name, number
from models.effects.force import ViscousDrag
from models.effects.friction import Stribeck
from models.effects.sensor import SensorDelay
from models.identification.kinds.axis.coordinates import Coordinates, turned_name, turned_unit
from models.identification.kinds.ranges import Ranges, ranged
from models.rigs.benches import AXIS


class AxisDrag(ViscousDrag):
    """`viscous_drag` in the newtons of a stage; exponents near 0 are a film that thins with shear."""

    grid = by_name(exponent=(0.15, 0.3, 0.6, 1.5, 2.0))
    probe = 1.0
    coefficient_N = number(0.0, "N at 10 mm/s", -100.0, 100.0)
    exponent = number(0.5, "1", 0.1, 3.0)


class AxisStribeck(Stribeck):
    """`stribeck` as its name is meant: extra resistance at low speed, never less."""

    grid = by_name(speed_m_s=(0.001, 0.003, 0.01, 0.03))
    excess = number(0.0, "1", 0.0, 3.0)


class AxisDelay(SensorDelay):
    """`sensor_delay` of a position reading, milliseconds at most."""

    probe = 2e-4
    delay_s = number(0.0, "s", 0.0, 0.01)


VARIANTS: Final[tuple[type[Effect], ...]] = (AxisStribeck, AxisDrag, AxisDelay)


@dataclass(frozen=True)
class Size:
    """Greatest speed, acceleration and force, lowest and highest position, usual load; SI, along or about the axis."""

    speed: float
    acceleration: float
    force: float
    low: float
    high: float
    load: float = 1.0


def candidates(c: Coordinates, size: Size | None, catalogue: Catalogue = CATALOGUE) -> tuple[type[Effect], ...]:
    """The effects that a search tries on an axis, in ranges that follow from its records' `size` where known."""
    declared = [e for e in catalogue.acting_on(AXIS.id, VARIANTS) if c.turns or "turning" not in e.needs]
    sized = _ranges(size) if size else {}
    if c.turns:
        return tuple(_about(e, sized.get(e.id, Ranges())) for e in declared)
    return tuple(ranged(e, _wider(e, sized[e.id])) if e.id in sized else e for e in declared)


def _wider(effect: type[Effect], sized: Ranges) -> Ranges:
    """The declared ranges of a stage in metres and newtons, widened to those of its records."""
    own = [(p, sized.of[p.name]) for p in effect.parameters() if p.name in sized.of and p.role == ""]
    return Ranges({p.name: (p.value, min(p.lower, low), max(p.upper, high)) for p, (_, low, high) in own})


def _ranges(size: Size) -> Mapping[str, Ranges]:
    v, f, s = size.speed, size.force, max(size.high - size.low, 1e-9)
    waves = tuple(float(w) for w in np.geomspace(s / 16, 0.7 * s, 20))
    return {
        "stribeck": Ranges(
            {"speed_m_s": (0.02 * v, 5e-4 * v, 0.7 * v)}, {"speed_m_s": (0.005 * v, 0.02 * v, 0.08 * v, 0.25 * v)}
        ),
        "viscous_drag": Ranges({"coefficient_N": (0.0, -3 * f, 3 * f)}, probe=0.02 * f),
        "fold_periodic": Ranges(
            {"wavelength_m": (s / 5, s / 20, s)}, {"wavelength_m": waves, "phase_rad": (0.0, 1.5707963)}
        ),
        "lumen_taper": Ranges(
            {
                "slope_per_m": (0.0, -5 / s, 5 / s),
                "bend_per_m2": (0.0, -20 / s**2, 20 / s**2),
                "curl_per_m3": (0.0, -60 / s**3, 60 / s**3),
                "reach_m": (s, 0.1 * s, 10 * s),
                "middle_m": (0.5 * (size.low + size.high), size.low, size.high),
            },
            {"reach_m": (0.3 * s, 2 * s)},
            0.3 / s,
        ),
        "gravity_over_angle": Ranges({"torque_N_m": (0.0, -10 * f, 10 * f)}, probe=0.1 * f),
        "spring_over_position": Ranges({"stiffness_N_per_m": (0.0, -20 * f / s, 20 * f / s)}, probe=0.1 * f / s),
        "load_dependent_friction": Ranges(
            {"growth_per_load": (0.0, -1 / size.load, 50 / size.load)}, probe=0.1 / size.load
        ),
    }


def _about(effect: type[Effect], sized: Ranges) -> type[Effect]:
    """The same law about an axis that turns, with parameters named as there."""
    if "turning" in effect.needs:
        return ranged(effect, sized)
    names = {p.name: turned_name(p.name) for p in effect.parameters()}
    hooks = {name: _renamed(getattr(effect, name), names) for name in HOOKS if effect.answers(name)}
    return ranged(effect, sized, lambda p: replace(p, name=turned_name(p.name), unit=turned_unit(p.unit)), **hooks)


def _renamed(hook: Callable[..., Any], names: Mapping[str, str]) -> Callable[..., Any]:
    """A hook that finds its parameters under their names about the axis."""
    at = list(signature(hook).parameters).index("p")

    @wraps(hook)
    def renamed(*given: Any) -> Any:
        return hook(*given[:at], {name: given[at][turned] for name, turned in names.items()}, *given[at + 1 :])

    return renamed
