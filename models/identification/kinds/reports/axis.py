"""What the report says about a stage: its equations, what its data cannot tell, what to measure next."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.effects.equation import LEFT, TORQUE, lines_of
from models.formula import Formula, Line, equal, symbols
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.zero_phase import decimate, sampling_rate
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta


@dataclass(frozen=True)
class Ripple:
    """Amplitude in N (N m), wavelength in m (rad), phase in rad at x = 0, share of the residual's power, its chance."""

    amplitude: float
    wavelength: float
    phase_rad: float
    share: float
    p: float


def equations(kind: AxisKind, theta: Theta) -> list[Line]:
    """The model, SI units: the base, then what each effect adds to it."""
    c = kind.coordinates
    inertia, viscous, coulomb, offset = (Formula.of(theta[name]) for name in c.base)
    effects = [effect for effect in kind.effects if effect.id in theta.effects]
    a, v, scale, force, torque = symbols("a v lambda F T")
    head, added = (torque, Formula(TORQUE)) if c.turns else (force, Formula(LEFT["force"][0]))
    friction = viscous * v + coulomb * np.sign(v)
    if any(effect.answers("level") for effect in effects):
        friction = scale * friction
    total = inertia * a + friction + offset
    if any(effect.answers("force") for effect in effects):
        total = total - added
    return [[equal(head, total)], *lines_of(effects, theta, turns=c.turns)]


def statements(kind: AxisKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on what these data cannot tell and what remains."""
    theta = theta_by_stage.get("augmented") or theta_by_stage["calibrated"]
    out = [_what_is_left(kind, theta, records), _where_it_remains(kind, theta, records)]
    if ("directional_asymmetry", "asymmetry") in theta:
        out.append(_asymmetry(kind, theta))
    ripples = [found for r in records if (found := find_ripple(kind, r, theta)) is not None]
    if ripples:
        out.append(_ripples(kind, ripples))
    if ("sensor_delay", "delay_s") in theta:
        late = 1e3 * theta["sensor_delay", "delay_s"]
        out.append(
            f"A position read {late:.2f} ms late and a drive that lags by {late:.2f} ms (actuator_lag) are the same "
            f"below 40 Hz to {100 * (2 * np.pi * 40 * late * 1e-3) ** 2 / 2:.1f} %."
        )
    if theta.get(("viscous_drag", "exponent"), 1.0) < SET.sublinear:
        out.append(
            "The extra drag grows ever slower with speed, as a lubricant that thins with shear does: near rest the "
            "stage resists less, not more, the opposite of Stribeck."
        )
    return out


def next_experiment(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What to measure to tell equivalents apart."""
    wishes = []
    if ("directional_asymmetry", "asymmetry") in theta:
        wishes.append(
            "hold the stage still at several places in both directions (a constant offset stays, an asymmetry does not)"
        )
    if ("sensor_delay", "delay_s") in theta:
        wishes.append(
            "log the motor current with the position (a lag of the drive shows there, a late reading does not)"
        )
    if ("viscous_drag", "exponent") in theta:
        wishes.append(
            f"sweep slowly from 0.1 to 20 m{kind.coordinates.length_unit}/s at constant speeds (film friction or an"
            " elastic start of sliding)"
        )
    return "; ".join(wishes) or None


def _where_it_remains(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str:
    squares = {"accelerating": 0.0, "cruising": 0.0}
    for record in records:
        rate = sampling_rate(record["t_s"])
        error = kind.residual(record, theta)
        moving = np.abs(decimate(kind.signals(record)[kind.coordinates.names[2]], rate, kind.band))
        fast = moving > SET.axis_moves * np.max(moving)
        squares["accelerating"] += float(np.sum(error[fast] ** 2))
        squares["cruising"] += float(np.sum(error[~fast] ** 2))
    share = 100 * squares["accelerating"] / max(sum(squares.values()), 1e-300)
    return f"{share:.0f} % of what remains (mean square) lies where the stage accelerates, the rest where it cruises."


def _what_is_left(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str:
    word, left = kind.coordinates.names[3], kind.error(records, [kind.predict(r, theta) for r in records])
    floor = kind.noise_floor(records)
    if np.isnan(floor):
        return (
            f"Nothing tells the noise of the {word} (no repeats that differ, no noise of its own, none stated): it may"
            f" be the command. No floor is claimed; the model leaves {left:.3g} %, and what is below"
            f" {100 * SET.axis_untold:g} % is not looked for."
        )
    return f"Noise and repeats of the same motion leave {floor:.2f} % of the {word}; the model leaves {left:.2f} %."


def _ripples(kind: AxisKind, found: Sequence[Ripple]) -> str:
    first, c = found[0], kind.coordinates
    wave = f"{first.wavelength:.4g} rad" if c.turns else f"{1e3 * first.wavelength:.3f} mm"
    return (
        f"A {c.names[3]} of {first.amplitude:.3g} {c.force_unit} periodic in position, {wave}, the same sign"
        f" going and coming back, makes {100 * first.share:.0f} % of what remains (p = {first.p:.0e}): cogging of the"
        " motor or ripple of the screw. Its phase belongs to where the position was zeroed, which another record need"
        " not share, so it stays out of the model."
    )


def _asymmetry(kind: AxisKind, theta: Theta) -> str:
    c = kind.coordinates
    _, viscous, coulomb, offset = (theta[name] for name in c.base)
    share = theta["directional_asymmetry", "asymmetry"]
    constant = offset + share * coulomb
    unit = c.units[1]
    return (
        f"A constant offset and a direction-dependent Coulomb friction are the same {c.names[3]} while the axis moves:"
        f" only their sum, {constant:+.3g} {c.force_unit}, is identifiable. What differs between the directions is the"
        f" friction that grows with speed: {viscous * (1 + share):.3g} {unit} forward,"
        f" {viscous * (1 - share):.3g} {unit} backward."
    )


def find_ripple(kind: AxisKind, record: Record, theta: Theta) -> Ripple | None:
    """The strongest `A sin(2 pi x/L + phi)` in the filtered residual; None where chance gives as much once in a
    hundred.

    Wavelengths a quarter turn apart over the stroke; the chance counts all of them and one independent sample in three.
    """
    rate = sampling_rate(record["t_s"])
    c = kind.coordinates
    x = kind.signals(record)[c.names[0]]
    e = kind.residual(record, theta) * kind.noise(record).weight
    e = e - e.mean()
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
    wave, (sine, cosine) = found
    return Ripple(math.hypot(sine, cosine), float(1 / wave), math.atan2(cosine, sine), best, p)
