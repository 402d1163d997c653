"""The catalogue's effects on an axis: in the newtons and milliseconds of a stage, in ranges that follow from its
records, and about the axis for one that turns.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect, Values
from models.effects.force.viscous_drag import ViscousDrag
from models.effects.friction.stribeck import Stribeck
from models.effects.sensor.sensor_delay import SensorDelay
from models.identification.kinds.axis.coordinates import Coordinates, turned_name, turned_unit
from models.identification.kinds.variant import Range, variant
from models.parameter import Name, Parameter
from models.rigs.axis import AXIS


@dataclass(frozen=True)
class AxisDrag(ViscousDrag):
    """`viscous_drag` in the newtons of a stage; exponents near 0 are a film that thins with shear."""

    grid = MappingProxyType({"exponent": (0.15, 0.3, 0.6, 1.5, 2.0)})
    probe = 1.0
    coefficient_N: Parameter = Parameter(
        "coefficient_N", 0.0, "N at 10 mm/s", -100.0, 100.0, ViscousDrag.source, fit=True
    )
    exponent: Parameter = Parameter("exponent", 0.5, "1", 0.1, 3.0, ViscousDrag.source, fit=True)


@dataclass(frozen=True)
class AxisStribeck(Stribeck):
    """`stribeck` as its name is meant: extra resistance at low speed, never less."""

    grid = MappingProxyType({"speed_m_s": (0.001, 0.003, 0.01, 0.03)})
    excess: Parameter = Parameter("excess", 0.0, "1", 0.0, 3.0, Stribeck.source, fit=True)


@dataclass(frozen=True)
class AxisDelay(SensorDelay):
    """`sensor_delay` of a position reading, milliseconds at most."""

    probe = 2e-4
    delay_s: Parameter = Parameter("delay_s", 0.0, "s", 0.0, 0.01, SensorDelay.source, fit=True)


VARIANTS: Final[tuple[type[Effect], ...]] = (AxisStribeck, AxisDrag, AxisDelay)


@dataclass(frozen=True)
class Size:
    """How large a series of records is: the greatest speed, acceleration and force, the places (lowest, highest), a
    usual load; SI units, along or about the axis.
    """

    speed: float
    acceleration: float
    force: float
    low: float
    high: float
    load: float = 1.0

    @property
    def travel(self) -> float:
        """Span of the places."""
        return max(self.high - self.low, 1e-9)


def candidates(c: Coordinates, size: Size | None, catalogue: Catalogue = CATALOGUE) -> tuple[type[Effect], ...]:
    """The effects that a search tries on an axis with these coordinates, in ranges that follow from its records' `size`
    where that is known.
    """
    declared = [e for e in catalogue.acting_on(AXIS.id, VARIANTS) if c.turns or "turning" not in e.needs]
    if size is None and not c.turns:
        return tuple(declared)
    ranges = _ranges(size) if size else {}
    if not c.turns:
        return tuple(_variant(e, c, _wider(e, ranges), None, None) for e in declared)
    grids = _grids(size) if size else {}
    probes = _probes(size) if size else {}
    return tuple(_variant(e, c, ranges, grids.get(e.id), probes.get(e.id)) for e in declared)


def _wider(effect: type[Effect], ranges: Mapping[Name, Range]) -> Mapping[Name, Range]:
    """A stage's ranges: those declared in metres and newtons, wider where its records ask for more."""
    own = ((p, ranges.get((effect.id, p.name))) for p in effect.parameters() if p.role == "")
    return {(effect.id, p.name): (p.value, min(p.lower, told[1]), max(p.upper, told[2])) for p, told in own if told}


def _ranges(size: Size) -> Mapping[Name, Range]:
    v, f, s = size.speed, size.force, size.travel
    middle = 0.5 * (size.low + size.high)
    return {
        ("stribeck", "speed_m_s"): (0.02 * v, 5e-4 * v, 0.7 * v),
        ("viscous_drag", "coefficient_N"): (0.0, -3 * f, 3 * f),
        ("fold_periodic", "wavelength_m"): (s / 5, s / 20, s),
        ("lumen_taper", "slope_per_m"): (0.0, -5 / s, 5 / s),
        ("lumen_taper", "bend_per_m2"): (0.0, -20 / s**2, 20 / s**2),
        ("lumen_taper", "curl_per_m3"): (0.0, -60 / s**3, 60 / s**3),
        ("lumen_taper", "reach_m"): (s, 0.1 * s, 10 * s),
        ("lumen_taper", "middle_m"): (middle, size.low, size.high),
        ("gravity_over_angle", "torque_N_m"): (0.0, -10 * f, 10 * f),
        ("spring_over_position", "stiffness_N_per_m"): (0.0, -20 * f / s, 20 * f / s),
        ("load_dependent_friction", "growth_per_load"): (0.0, -1 / size.load, 50 / size.load),
    }


def _grids(size: Size) -> Mapping[str, Mapping[str, tuple[float, ...]]]:
    v, s = size.speed, size.travel
    return {
        "stribeck": {"speed_m_s": (0.005 * v, 0.02 * v, 0.08 * v, 0.25 * v)},
        "fold_periodic": {
            "wavelength_m": tuple(float(w) for w in np.geomspace(s / 16, 0.7 * s, 20)),
            "phase_rad": (0.0, 1.5707963),
        },
        "lumen_taper": {"reach_m": (0.3 * s, 2 * s)},
    }


def _probes(size: Size) -> Mapping[str, float]:
    return {
        "viscous_drag": 0.02 * size.force,
        "lumen_taper": 0.3 / size.travel,
        "gravity_over_angle": 0.1 * size.force,
        "spring_over_position": 0.1 * size.force / size.travel,
        "load_dependent_friction": 0.1 / size.load,
    }


def _variant(
    effect: type[Effect],
    c: Coordinates,
    ranges: Mapping[Name, Range],
    grid: Mapping[str, tuple[float, ...]] | None,
    probe: float | None,
) -> type[Effect]:
    """The same law with other ranges; its parameters by their names about the axis where that turns."""
    turns = c.turns and "turning" not in effect.needs
    names = {p.name: turned_name(p.name) if turns else p.name for p in effect.parameters()}
    parameters = tuple(_parameter(effect, p, names[p.name], turns, ranges) for p in effect.parameters())
    told = {names[name]: values for name, values in (effect.grid if grid is None else grid).items()}
    ours = {old: new for old, new in names.items() if old != new}
    hooks = {hook: _renamed(getattr(effect, hook), ours) for hook in _HOOKS if ours and effect.answers(hook)}
    return variant(effect, parameters, told, probe, **hooks)


def _parameter(effect: type[Effect], p: Parameter, name: str, turns: bool, ranges: Mapping[Name, Range]) -> Parameter:
    value, lower, upper = ranges.get((effect.id, p.name), (p.value, p.lower, p.upper))
    spread = p.spread * (upper - lower) / (p.upper - p.lower) if np.isfinite(p.spread) else p.spread
    unit = turned_unit(p.unit) if turns else p.unit
    return replace(p, name=name, value=value, lower=lower, upper=upper, spread=spread, unit=unit)


_HOOKS: Final = ("level", "force", "measured", "delay")


def _renamed(hook: Any, names: Mapping[str, str]) -> Any:
    """A hook that finds its parameters under their names about the axis."""
    if hook.__name__ == "delay":
        return lambda self, p: hook(self, _Named(p, names))
    if hook.__name__ == "measured":
        return lambda self, s, p, z, y: hook(self, s, _Named(p, names), z, y)
    return lambda self, s, p, z: hook(self, s, _Named(p, names), z)


class _Named(Mapping[str, Any]):
    """Parameters under the names along a line that an effect asks for."""

    def __init__(self, values: Values, names: Mapping[str, str]) -> None:
        self._values, self._names = values, names

    def __getitem__(self, name: str) -> Any:
        return self._values[self._names.get(name, name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)
