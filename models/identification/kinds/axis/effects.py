"""The catalogue's effects on an axis: in a stage's units, in ranges that follow from its records, and about an axis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from inspect import signature
from typing import Any, Final

import numpy as np

from models.effects import CATALOGUE, Catalogue
from models.effects.drive import ActuatorDeadZone, ActuatorSaturation
from models.effects.effect import HOOKS, Effect, Signals, Value, Values, by_name, number
from models.effects.force import LoadForce, ViscousDrag
from models.effects.friction import Stribeck, Warming
from models.effects.sensor import SensorDelay
from models.identification.kinds.axis.coordinates import Coordinates, turned_name, turned_unit
from models.identification.kinds.axis.logged import Logged
from models.identification.kinds.ranges import Ranges, ranged
from models.parameter import Parameter
from models.rigs.benches import AXIS, DRIVEN_AXIS

TEMPERATURE: Final = "temperature_degC"


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


class AxisSaturation(ActuatorSaturation):
    """Scale `(1 + (a u_cmd^2)^(1/q))^(-q/2)` of the drive's force, which ends at `1/sqrt(a)`: softly (q = 1), or hard
    as the limit of a current does (q = 0, as 0.05).
    """

    grid = by_name(softness=(1.0, 0.25))
    inverse_square = number(0.0, "1/command^2", 0.0, 1e12, symbol="a")
    softness = number(1.0, "1", 0.0, 2.0, symbol="q")

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        soft = np.maximum(p["softness"], 0.05)
        return (1 + np.maximum(p["inverse_square"] * s.command**2, 0.0) ** (1 / soft)) ** (-0.5 * soft)


class AxisDeadZone(ActuatorDeadZone):
    """`actuator_dead_zone` of a force, torque, current or voltage of any size."""

    zone = number(0.0, "of the command's unit", 0.0, 1e6, symbol="d")


class WarmedBy(Warming):
    """`warming` by a logged temperature: friction falls as the viscosity of a lubricant does."""

    grid = by_name()
    probe = 0.01
    needs = ("logged",)
    fall_per_K = number(0.0, "1/K", -1.0, 1.0, symbol="c")

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        return (cls.fall_per_K,)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return np.exp(-p["fall_per_K"] * (s.logged(TEMPERATURE) - 20.0))


_OF_RECORDS: Final = (
    *("load_force", "presliding", "torque_ripple", "warming", "elastic_drive"),
    *("actuator_dead_zone", "actuator_saturation", "drive_play"),
)
"""Effects whose ranges are those of the records, also along a line."""
VARIANTS: Final[tuple[type[Effect], ...]] = (AxisStribeck, AxisDrag, AxisDelay)


@dataclass(frozen=True)
class Size:
    """Greatest speed, acceleration, force, ends of the position, SI; the greatest command where that is no force."""

    speed: float
    acceleration: float
    force: float
    low: float
    high: float
    command: float = 0.0


def candidates(
    c: Coordinates,
    size: Size | None,
    catalogue: Catalogue = CATALOGUE,
    loads: Sequence[Logged] = (),
    driven: bool = False,
) -> tuple[type[Effect], ...]:
    """The effects that a search tries on an axis, in ranges that follow from its records' `size` where known, of the
    logged inputs `loads`; those of a drive too where its force is `driven`.
    """
    warm = (WarmedBy,) if any(one.name == TEMPERATURE for one in loads) else ()
    acting = catalogue.acting_on(AXIS.id, (*VARIANTS, *warm))
    if driven:
        more = catalogue.acting_on(DRIVEN_AXIS.id, (AxisDeadZone, AxisSaturation))
        acting += tuple(effect for effect in more if effect not in acting)
    declared = [e for e in acting if c.turns or "turning" not in e.needs]
    sized = _sized(declared, c, size)
    return tuple(_of_loads(e, loads, c, size.force if size else 1.0) for e in sized) if loads else sized


def _of_loads(effect: type[Effect], loads: Sequence[Logged], c: Coordinates, force: float) -> type[Effect]:
    """`effect` with a number for each of the inputs that stand out, in place of that of a single one."""
    pushes = effect.id == LoadForce.id
    own, *more = effect.parameters()
    chosen = [one for one in loads if (one.pushes if pushes else one.scales and one.name != TEMPERATURE)]
    if not own.name.endswith("per_load") or not chosen:
        return effect
    most = [30 * force / one.span if pushes else 50 / one.size for one in chosen]
    least = [-high if pushes else -0.02 * high for high in most]
    units = [_ratio(c.force_unit if pushes else "1", one.unit) for one in chosen]
    rows = [
        replace(own, name=own.name.removesuffix("load") + one.name, unit=unit, lower=low, upper=high)
        for one, unit, low, high in zip(chosen, units, least, most, strict=True)
    ]
    made = (*rows, *more)
    return ranged(effect, Ranges(probe=0.002 * most[0]), parameters=classmethod(lambda cls: made))


def _ratio(one: str, other: str) -> str:
    return "1" if one == other else one if other == "1" else f"{one}/({other})" if " " in other else f"{one}/{other}"


def _sized(declared: Sequence[type[Effect]], c: Coordinates, size: Size | None) -> tuple[type[Effect], ...]:
    sized = _ranges(size) if size else {}
    if WarmedBy in declared:  # over no way
        sized = {name: ranges for name, ranges in sized.items() if name != WarmedBy.id}
    if c.turns:
        return tuple(_about(e, sized.get(e.id, Ranges())) for e in declared)
    own = {e.id: sized[e.id] if e.id in _OF_RECORDS else _wider(e, sized[e.id]) for e in declared if e.id in sized}
    return tuple(ranged(e, own[e.id]) if e.id in own else e for e in declared)


def _wider(effect: type[Effect], sized: Ranges) -> Ranges:
    """The declared ranges of a stage in metres and newtons, widened to those of its records."""
    own = [(p, sized.of[p.name]) for p in effect.parameters() if p.name in sized.of and p.role == ""]
    return Ranges({p.name: (p.value, min(p.lower, low), max(p.upper, high)) for p, (_, low, high) in own})


def _ranges(size: Size) -> Mapping[str, Ranges]:
    v, f, s = size.speed, size.force, max(size.high - size.low, 1e-9)
    a, u = size.acceleration, size.command or f
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
        "load_force": Ranges(
            {
                "slope_per_m": (0.0, -2 / s, 2 / s),
                "middle_m": (0.5 * (size.low + size.high), size.low, size.high),
            }
        ),
        "presliding": Ranges({"distance_m": (0.0, 0.0, 0.3 * s)}, probe=0.003 * s),
        "torque_ripple": Ranges(
            {
                "force_N": (0.0, -3 * f, 3 * f),
                "wavelength_m": (s / 5, s / 20, s / 2),
                "second_sin_N": (0.0, -f, f),
                "second_cos_N": (0.0, -f, f),
            },
            {"wavelength_m": tuple(s / (2.01 + 0.5 * k) for k in range(29)), "phase_rad": (0.0, 1.5707963)},
            0.02 * f,
        ),
        "warming": Ranges({"length_m": (3 * s, 0.1 * s, 1e3 * s)}, {"length_m": (s, 10 * s, 100 * s)}),
        "actuator_dead_zone": Ranges({"zone": (0.0, 0.0, u)}, probe=0.02 * u),
        "actuator_saturation": Ranges({"inverse_square": (0.0, 0.0, 20 / u**2)}, probe=1 / u**2),
        "elastic_drive": Ranges({"load_kg": (0.0, 0.0, 30 * f / a)}, probe=0.1 * f / a),
        "drive_play": Ranges(
            {"load_kg": (0.0, 0.0, 30 * f / a), "play_m": (0.01 * s, 0.0, 0.3 * s), "rubbing_m_s2": (0.1 * a, 0.0, a)},
            {"frequency_Hz": (8.0, 25.0), "play_m": (0.002 * s, 0.01 * s, 0.05 * s)},
            0.1 * f / a,
        ),
    }


def _about(effect: type[Effect], sized: Ranges) -> type[Effect]:
    """The same law about an axis that turns, with parameters named as there."""
    if "turning" in effect.needs:
        return ranged(effect, sized)
    names = {p.name: turned_name(p.name) for p in effect.parameters()}
    hooks: dict[str, Any] = {n: _renamed(getattr(effect, n), names) for n in HOOKS if effect.answers(n)}
    hooks["forms"] = classmethod(lambda cls, s, p, z: effect.forms(s, _Turned(p, names), z))
    return ranged(effect, sized, lambda p: replace(p, name=turned_name(p.name), unit=turned_unit(p.unit)), **hooks)


def _renamed(hook: Callable[..., Any], names: Mapping[str, str]) -> Callable[..., Any]:
    """A hook that finds its parameters under their names about the axis."""
    at = list(signature(hook).parameters).index("p")

    @wraps(hook)
    def renamed(*given: Any) -> Any:
        return hook(*given[:at], _Turned(given[at], names), *given[at + 1 :])

    return renamed


class _Turned(dict[str, Any]):
    """The values `given` under their names about an axis, by their names along a line."""

    def __init__(self, given: Mapping[str, Any], names: Mapping[str, str]) -> None:
        self._given, self._names = given, names

    def __missing__(self, name: str) -> Any:
        return self._given[self._names.get(name, name)]
