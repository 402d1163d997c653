"""What the report says about an axis: its equations, what its data cannot show, what to measure next."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from models.effects import REFINEMENTS
from models.effects.equation import LEFT, TORQUE, lines_of
from models.formula import Formula, Line, equal, symbols
from models.identification.finding import Alike
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.zero_phase import decimate, sampling_rate
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)


@dataclass(frozen=True)
class Ripple:
    """Amplitude in N (N m), wavelength in m (rad), share of the residual's power, chance of as large a share."""

    amplitude: float
    wavelength: float
    share: float
    p: float


def equations(kind: AxisKind, theta: Theta) -> list[Line]:
    """The model, SI units: the base, then what each effect adds to it."""
    c = kind.coordinates
    inertia, viscous, coulomb, offset = (Formula.of(theta[name]) for name in c.base)
    effects = [effect for effect in (*kind.effects, *REFINEMENTS) if effect.id in theta.effects]
    a, v, scale, force, torque = symbols("a v lambda F T")
    head, added = (torque, Formula(TORQUE)) if c.turns else (force, Formula(LEFT["force"][0]))
    friction = viscous * v + coulomb * np.sign(v)
    if any(effect.answers("shared") for effect in effects):
        friction = Formula(LEFT["weight"][0]) * viscous * v + scale * coulomb * np.sign(v)
    elif any(effect.answers("level") for effect in effects):
        friction = scale * friction
    total = inertia * a + friction + offset
    if any(effect.answers("force") for effect in effects):
        total = total - added
    return [[equal(head, total)], *lines_of(effects, theta, turns=c.turns)]


def statements(kind: AxisKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    theta = theta_by_stage.get("augmented") or theta_by_stage["calibrated"]
    out = [_size_of_residual(kind, theta, records), _accelerating(kind, theta, records)]
    if ("directional_asymmetry", "asymmetry") in theta:
        out.append(_asymmetry(kind, theta))
    ripples = (find_ripple(kind, record, theta) for record in records)
    ripple = next((found for found in ripples if found is not None), None)
    if ripple is not None:
        c = kind.coordinates
        amplitude, wave = Quantity(ripple.amplitude, c.force_unit), Quantity(ripple.wavelength, c.length_unit)
        said = TEXT("axis_ripple", force=c.names[3], amplitude=amplitude, wave=wave, share=ripple.share, p=ripple.p)
        out.append(said)
    if ("sensor_delay", "delay_s") in theta:
        late = theta["sensor_delay", "delay_s"]
        out.append(TEXT("axis_late", delay=late, share=(2 * np.pi * 40 * late) ** 2 / 2))
    if theta.get(("viscous_drag", "exponent"), 1.0) < SET.sublinear:
        out.append(TEXT("axis_sublinear"))
    return out


def next_experiment(kind: AxisKind, theta: Theta, records: Sequence[Record], alike: Alike) -> str | None:
    wishes = {
        ("directional_asymmetry", "asymmetry"): TEXT("axis_hold"),
        ("sensor_delay", "delay_s"): TEXT("axis_current"),
        ("viscous_drag", "exponent"): TEXT("axis_sweep", unit=f"m{kind.coordinates.length_unit}/s"),
    }
    return "; ".join(wish for name, wish in wishes.items() if name in theta and alike.get(name[0])) or None


def _accelerating(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str:
    accelerating = total = 0.0
    for record in records:
        squares = kind.of_force(record, [theta])[0] ** 2
        acceleration = kind.signals(record)[kind.coordinates.names[2]]
        size = np.abs(decimate(acceleration, sampling_rate(record["t_s"]), kind.band))
        accelerating += float(np.sum(squares[size > SET.axis_moves * np.max(size)]))
        total += float(np.sum(squares))
    return TEXT("axis_accelerating", share=accelerating / max(total, 1e-300))


def _size_of_residual(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str:
    force, left = kind.coordinates.names[3], kind.error(records, [kind.predict(r, theta) for r in records])
    floor = kind.noise_floor(records)
    if np.isnan(floor):
        return TEXT("axis_no_floor", force=force, left=left, least=SET.axis_noise)
    return TEXT("axis_floor", force=force, floor=floor, left=left)


def _asymmetry(kind: AxisKind, theta: Theta) -> str:
    c = kind.coordinates
    _, viscous, coulomb, offset = (theta[name] for name in c.base)
    share = theta["directional_asymmetry", "asymmetry"]
    forward, backward = (Quantity(viscous * (1 + side * share), c.units[1]) for side in (1, -1))
    constant = Quantity(offset + share * coulomb, c.force_unit)
    return TEXT("axis_asymmetry", force=c.names[3], sum=constant, forward=forward, backward=backward)


def find_ripple(kind: AxisKind, record: Record, theta: Theta) -> Ripple | None:
    """The strongest `A sin(2 pi x/L + phi)` in the filtered residual; None where chance gives as much once in a
    hundred.

    Wavelengths a quarter turn apart over the stroke; the chance counts all of them and one independent sample in three.
    """
    rate = sampling_rate(record["t_s"])
    c = kind.coordinates
    x = kind.signals(record)[c.names[0]]
    e = kind.of_force(record, [theta])[0] * kind.noise(record).weight
    e = e - e.mean()
    if not e.any():
        return None
    step = 0.25 / max(float(np.ptp(x)), 1e-6)
    shortest, longest = (SET.pole_min_rad, SET.pole_max_rad) if c.turns else (SET.lead_min_m, SET.lead_max_m)
    waves = np.arange(1 / longest, 1 / shortest, step)
    best, found = 0.0, None
    for wave in waves:
        angle = 2 * math.pi * wave * x
        pair = np.column_stack([decimate(np.sin(angle), rate, kind.band), decimate(np.cos(angle), rate, kind.band)])
        weights, *_ = np.linalg.lstsq(pair, e, rcond=None)
        share = 1 - float(np.sum((e - pair @ weights) ** 2) / np.sum(e**2))
        if share > best:
            best, found = share, (wave, weights)
    p = min(1.0, len(waves) * (1 - best) ** (len(e) / 6))
    if found is None or p > SET.significant:
        return None
    wave, weights = found
    return Ripple(math.hypot(*weights), float(1 / wave), best, p)
