"""What the report says about a stage: its equations, what its data cannot tell, what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from models.effects.equation import lines_of
from models.files.record import Record
from models.identification.kind import Theta
from models.identification.kinds.axis.kind import AxisKind
from models.identification.kinds.axis.ripple import Ripple, find_ripple
from models.identification.kinds.axis.zero_phase import decimate, sampling_rate


def equations(kind: AxisKind, theta: Theta) -> list[str]:
    """The model in words and numbers, SI units: the base, then what each effect adds to it."""
    friction = f"({theta['viscous_friction_N_s_per_m']:.4g} v + {theta['coulomb_friction_N']:.4g} sgn(v))"
    effects = lines_of(kind.effects, theta)
    scaled = " times all friction scales" if any("friction scale" in line for line in effects) else ""
    added = ", less all added forces" if any("added force" in line for line in effects) else ""
    return [f"F = {theta['mass_kg']:.5g} a + {friction}{scaled} {theta['offset_N']:+.3g}{added}", *effects]


def statements(kind: AxisKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on what these data cannot tell and what remains."""
    theta = theta_by_stage.get("augmented") or theta_by_stage["calibrated"]
    floor, left = kind.noise_floor(records), kind.error(records, [kind.predict(r, theta) for r in records])
    out = [
        f"Repeats of the same motion leave {floor:.2f} % of the force; the model leaves {left:.2f} %.",
        _where_it_remains(kind, theta, records),
    ]
    if "directional_asymmetry.asymmetry" in theta:
        out.append(_asymmetry(theta))
    ripples = [found for r in records if (found := find_ripple(kind, r, theta)) is not None]
    if ripples:
        out.append(_ripples(ripples))
    if "sensor_delay.delay_s" in theta:
        late = 1e3 * theta["sensor_delay.delay_s"]
        out.append(
            f"A position read {late:.2f} ms late and a drive that lags by {late:.2f} ms (actuator_lag) are the same "
            f"below 40 Hz to {100 * (2 * np.pi * 40 * late * 1e-3) ** 2 / 2:.1f} %."
        )
    if theta.get("viscous_drag.exponent", 1.0) < 0.8:
        out.append(
            "The extra drag grows ever slower with speed, as a lubricant that thins with shear does: near rest the "
            "stage resists less, not more, the opposite of Stribeck."
        )
    return out


def next_experiment(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What to measure to tell equivalents apart."""
    wishes = []
    if "directional_asymmetry.asymmetry" in theta:
        wishes.append(
            "hold the stage still at several places in both directions (a constant offset stays, an asymmetry does not)"
        )
    if "sensor_delay.delay_s" in theta:
        wishes.append(
            "log the motor current with the position (a lag of the drive shows there, a late reading does not)"
        )
    if "viscous_drag.coefficient_N" in theta:
        wishes.append(
            "sweep slowly from 0.1 to 20 mm/s at constant speeds (film friction or an elastic start of sliding)"
        )
    return "; ".join(wishes) or None


def _where_it_remains(kind: AxisKind, theta: Theta, records: Sequence[Record]) -> str:
    squares = {"accelerating": 0.0, "cruising": 0.0}
    for record in records:
        rate = sampling_rate(record["t_s"])
        error = kind.residual(record, theta)
        moving = np.abs(decimate(kind.signals(record)["a_m_s2"], rate))
        fast = moving > 0.1 * np.max(moving)
        squares["accelerating"] += float(np.sum(error[fast] ** 2))
        squares["cruising"] += float(np.sum(error[~fast] ** 2))
    share = 100 * squares["accelerating"] / max(sum(squares.values()), 1e-300)
    return f"{share:.0f} % of what remains (mean square) lies where the stage accelerates, the rest where it cruises."


def _ripples(found: Sequence[Ripple]) -> str:
    first = found[0]
    return (
        f"A force of {first.amplitude_N:.2f} N periodic in position, {1e3 * first.wavelength_m:.3f} mm, the same sign"
        f" going and coming back, makes {100 * first.share:.0f} % of what remains (p = {first.p:.0e}): cogging of the"
        " motor or ripple of the screw. Its phase belongs to where the position was zeroed, which another record need"
        " not share, so it stays out of the model."
    )


def _asymmetry(theta: Theta) -> str:
    share, viscous = theta["directional_asymmetry.asymmetry"], theta["viscous_friction_N_s_per_m"]
    constant = theta["offset_N"] + share * theta["coulomb_friction_N"]
    return (
        "A constant offset and a direction-dependent Coulomb friction are the same force while the stage moves: only"
        f" their sum, {constant:+.2f} N, is told. What differs between the directions is the friction that grows with"
        f" speed: {viscous * (1 + share):.0f} N s/m forward, {viscous * (1 - share):.0f} N s/m backward."
    )
