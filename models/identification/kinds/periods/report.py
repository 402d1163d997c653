"""What the report says about stick-slip periods: the cycle in numbers, what one speed cannot tell, what to measure
next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from models.effects.equation import lines_of
from models.effects.formula import Formula
from models.files.record import Record, named
from models.identification.kind import Theta
from models.identification.kinds.periods.kind import PeriodsKind

_WIDEST = 5.0  # logarithm of how much stiffer or softer a wall may be


def equations(kind: PeriodsKind, theta: Theta) -> list[str]:
    """The cycle in words and numbers; for symbols in place of numbers its law alone."""
    law = f"T(u) = H_l(1 + |u|/{1e3 * kind.length_m:.4g} mm) s, slip when T(u_c) = f_c"
    if any(isinstance(value, Formula) for value in theta.values()):
        return [law, *lines_of(kind.effects, theta)]
    cycle = kind.cycle(kind.velocity_m_s, theta)
    rise = 1e3 * (cycle.peak - cycle.valley)
    return [
        law,
        f"F_e = {1e3 * cycle.valley:.2f} mN, f_c = {rise:.2f} mN, u_c = {1e3 * cycle.tooth.drag_m:.4f} mm",
        (
            f"period = {cycle.tooth.rise_s:.4f} s sticking + {cycle.tooth.fall_s:.4f} s slipping ="
            f" {cycle.tooth.period_s:.4f} s"
        ),
        *lines_of(kind.effects, theta),
    ]


def statements(kind: PeriodsKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on what one speed cannot tell."""
    theta = theta_by_stage["calibrated"]
    measured = np.concatenate([kind.measured(r) for r in records])
    period, v = float(measured[:, 0].mean()), kind.velocity_m_s
    out = [
        f"{stage.capitalize()}: {_off(kind, theta_by_stage[stage], records)}"
        for stage in ("nominal", "calibrated", "augmented")
        if stage in theta_by_stage
    ]
    limit = kind.levels(v, theta)[1]
    cycle = kind.cycle(v, theta)
    out.append(
        "Valley and peak are identified (hoop factor and friction): paper A's own 23.23 and 16.56 mN do not follow "
        "from its printed parameters. The period is not; with A's f_c = 16.56 mN its law gives "
        f"{_period(kind, 0.01656):.4f} s, with L_s = L = {1e3 * kind.capsule.cylinder_length_m:g} mm "
        f"{_period(shorter(kind), 0.01656):.4f} s."
    )
    with named(records[0]):
        factor = _stiffer_by(kind, limit, period)
    out.append(
        f"One speed cannot tell apart: a wall {factor:.2f} times stiffer at this drag of"
        f" {1e3 * cycle.tooth.drag_m / factor:.3f} mm, a wall {factor:.2f} times stiffer at every drag, a stretched"
        f" length of {1e3 * kind.length_m / factor:.1f} mm instead of {1e3 * kind.length_m:.1f} mm, and a wall that"
        " resists the rate of stretch (wall_viscosity). Quasi-static tests of the wall speak against the second, the"
        " capsule's size against the third."
    )
    out.append(
        f"A quicker recovery is not enough: sticking alone takes {cycle.tooth.rise_s:.3f} s against a measured period"
        f" of {period:.4f} s. A compliant string would lengthen the period, not shorten it."
    )
    return out


def next_experiment(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What would tell a stiffer wall from a shorter or a viscous one."""
    v = 1e3 * kind.velocity_m_s
    return (
        f"pull at several speeds ({v / 5:g} to {v * 20:g} mm/s): a stiff or short wall keeps the tooth's height but for"
        " the hoop law's own rise, a viscous one adds to it in proportion to speed; step and hold of 0.02 to 1 mm"
        " without slip: the force over the drag tells stiffening at small drag from a shorter wall, its decay in the"
        " hold tells viscosity; a capsule of another length for L_s"
    )


def shorter(kind: PeriodsKind) -> PeriodsKind:
    """The same pull with the cylinder alone as stretched length, `L_s = L`."""
    return replace(kind, length_m=kind.capsule.cylinder_length_m)


def _off(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> str:
    measured = np.concatenate([kind.measured(r) for r in records]).mean(0)
    predicted = np.concatenate([kind.predict(r, theta) for r in records]).mean(0)
    period, valley, peak = 100 * (predicted / measured - 1)
    return (
        f"period {predicted[0]:.4f} s ({period:+.0f} %), valley {valley:+.1f} %, peak {peak:+.1f} % off the measured"
        " means."
    )


def _period(kind: PeriodsKind, limit: float) -> float:
    return kind.tooth(limit, kind.velocity_m_s, {}).period_s


def _stiffer_by(kind: PeriodsKind, limit: float, period: float) -> float:
    """Common factor on the tension that gives the measured period. Raises ValueError where none between 1/150 and 150
    does.
    """

    def given(k: float) -> float:
        return _period(kind, limit / np.exp(k))

    if not given(_WIDEST) <= period <= given(-_WIDEST):
        raise ValueError(
            f"pull at {kind.velocity_m_s:g} m/s with teeth of {limit:.3g} N must have a period_s of"
            f" {given(_WIDEST):.3g} to {given(-_WIDEST):.3g} s, whatever the wall; got {period:.3g} s: is the speed"
            " right, and the forces in N?"
        )
    return float(np.exp(brentq(lambda k: given(k) - period, -_WIDEST, _WIDEST)))
