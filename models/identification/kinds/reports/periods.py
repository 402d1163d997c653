"""What the report says about stick-slip periods: the cycle in numbers, what the speeds tell, what to measure next."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from models.effects.equation import LEFT, lines_of
from models.formula import Formula, Line, called, equal, symbols
from models.identification.kind import Array
from models.identification.kinds.periods import PeriodsKind
from models.identification.settings import SET
from models.records.record import Record, named
from models.theta import Theta
from models.words.quantities import quantity


def equations(kind: PeriodsKind, theta: Theta) -> list[Line]:
    """The wall's law and its cycle at the speed of the rig file; for symbols in place of numbers the law alone."""
    u, u_c, f_c, L = symbols("u_w u_c f_c L")
    strain = called("H_l", 1 + np.abs(u) / L)
    if any(effect.answers("stiffening") and effect.id in theta.effects for effect in kind.effects):
        strain = strain * Formula(LEFT["stiffening"][0])
    law: Line = [equal(called("T", u), strain), ", ", equal(L, kind.length_m)]
    slip: Line = ["slip when ", equal(called("T", u_c), f_c)]
    if any(isinstance(value, Formula) for value in theta.values()):
        return [law, slip, *lines_of(kind.effects, theta)]
    cycle = kind.cycle(kind.velocity_m_s, theta)
    return [
        law,
        slip,
        [
            f"at {quantity(kind.velocity_m_s, 'm/s')}: ",
            equal(Formula("F_e"), cycle.valley),
            ", ",
            equal(f_c, cycle.peak - cycle.valley),
            ", ",
            equal(u_c, cycle.tooth.drag_m),
        ],
        [
            f"period: {quantity(cycle.tooth.rise_s, 's')} sticking, {quantity(cycle.tooth.fall_s, 's')} slipping,"
            f" {quantity(cycle.tooth.period_s, 's')} in all"
        ],
        *lines_of(kind.effects, theta),
    ]


def statements(kind: PeriodsKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on how far each stage is off, and on what these speeds can and cannot tell."""
    speeds = kind.speeds_of(records)
    out = [
        f"{stage.capitalize()}{f', {1e3 * v:g} mm/s' if len(speeds) > 1 else ''}: "
        f"{_off(kind, theta_by_stage[stage], records, float(v))}"
        for stage in ("nominal", "calibrated", "augmented")
        if stage in theta_by_stage
        for v in speeds
    ]
    theta = theta_by_stage["calibrated"]
    return out + (_one_speed(kind, theta, records) if len(speeds) == 1 else _several_speeds(kind, theta, records))


def _one_speed(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> list[str]:
    v = float(kind.speeds_of(records)[0])
    period = float(_means(kind, records, v)[0])
    limit, cycle, as_paper = (
        kind.levels(v, theta)[1],
        kind.cycle(v, theta),
        replace(kind, return_speed_m_s=SET.return_m_s),
    )
    out = [
        "Valley and peak are identified (hoop factor and friction): paper A's own 23.23 and 16.56 mN do not follow "
        "from its printed parameters. The period is not; with A's f_c = 16.56 mN its law gives at 0.5 mm/s "
        f"{_period(as_paper, 0.01656, SET.pull_m_s):.4f} s, with L_s = L = {1e3 * kind.capsule.cylinder_length_m:g} mm "
        f"{_period(shorter(as_paper), 0.01656, SET.pull_m_s):.4f} s."
    ]
    with named(records[0]):
        factor = _stiffer_by(kind, limit, period, v)
    out.append(
        f"One speed cannot tell apart: a wall {factor:.2f} times stiffer at this drag of"
        f" {1e3 * cycle.tooth.drag_m / factor:.3f} mm, a wall {factor:.2f} times stiffer at every drag, a stretched"
        f" length of {1e3 * kind.length_m / factor:.1f} mm instead of {1e3 * kind.length_m:.1f} mm, and a wall that"
        " resists the rate of stretch (wall_viscosity). Quasi-static tests of the wall speak against the second, the"
        " capsule's size against the third."
    )
    if cycle.tooth.rise_s > period:
        out.append(
            f"A quicker recovery is not enough: sticking alone takes {cycle.tooth.rise_s:.3f} s against a measured"
            f" period of {period:.4f} s. A compliant string would lengthen the period, not shorten it."
        )
    return out


def _several_speeds(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> list[str]:
    """How period and travel per period change from the slowest to the fastest pull, measured and calibrated."""
    speeds = kind.speeds_of(records)
    slow, fast = float(speeds[0]), float(speeds[-1])
    (first, low, _), (last, high, top) = (_means(kind, records, v) for v in (slow, fast))
    model = [kind.cycle(v, theta) for v in (slow, fast)]
    periods = [cycle.tooth.period_s for cycle in model]
    return [
        f"From {1e3 * slow:g} to {1e3 * fast:g} mm/s the measured period goes from {first:.4g} to {last:.4g} s"
        f" (times {last / first:.3g}), the calibrated model's from {periods[0]:.4g} to {periods[1]:.4g} s (times"
        f" {periods[1] / periods[0]:.3g}); the measured valley goes times {high / low:.3g}, the model's times"
        f" {model[1].valley / model[0].valley:.3g}.",
        f"Travel per period: {1e3 * slow * first:.3g} mm at {1e3 * slow:g} mm/s, {1e3 * fast * last:.3g} mm at"
        f" {1e3 * fast:g} mm/s. By the wall's law teeth of the measured {1e3 * (top - high):.3g} mN at"
        f" {1e3 * fast:g} mm/s take {1e3 * kind.tooth(top - high, fast, theta).drag_m:.3g} mm of drag before they slip:"
        " what a period takes beyond that is no stick of this wall.",
        "Speed is not all that may differ between pulls on separate specimens: what is told here of speed holds as far"
        " as capsule and gut were the same.",
    ]


def next_experiment(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What would tell a stiffer wall from a shorter or viscous one; with several speeds, periods in time from space."""
    speeds = kind.speeds_of(records)
    if len(speeds) > 1:
        low, high = 1e3 * float(speeds[0]), 1e3 * float(speeds[-1])
        between = ", ".join(f"{v:.2g}" for v in np.geomspace(low, high, 5))
        return (
            f"pull one capsule through one specimen at {between} mm/s, twice over the same stretch, and log force"
            " against position: teeth that come again at the same places are folds of the wall, teeth that do not are"
            " stick and slip, and their period over speed tells where one passes into the other"
        )
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


def _means(kind: PeriodsKind, records: Sequence[Record], speed: float, theta: Theta | None = None) -> Array:
    """Mean period, valley and peak (3,) at a speed, measured or, with `theta`, predicted."""
    rows = [kind.measured(r) if theta is None else kind.predict(r, theta) for r in records]
    at = [np.abs(r.columns.get("velocity_m_s", np.full(len(r), speed))) == speed for r in records]
    return np.asarray(np.concatenate([row[here] for row, here in zip(rows, at, strict=True)]).mean(0))


def _off(kind: PeriodsKind, theta: Theta, records: Sequence[Record], speed: float) -> str:
    predicted = _means(kind, records, speed, theta)
    period, valley, peak = 100 * (predicted / _means(kind, records, speed) - 1)
    return (
        f"period {predicted[0]:.4f} s ({period:+.0f} %), valley {valley:+.1f} %, peak {peak:+.1f} % off the measured"
        " means."
    )


def _period(kind: PeriodsKind, limit: float, speed: float) -> float:
    return kind.tooth(limit, speed, Theta()).period_s


def _stiffer_by(kind: PeriodsKind, limit: float, period: float, speed: float) -> float:
    """Common factor on the tension that gives the measured period. Raises ValueError beyond 1/150 to 150."""

    def given(k: float) -> float:
        return _period(kind, limit / np.exp(k), speed)

    if not given(SET.period_widest) <= period <= given(-SET.period_widest):
        raise ValueError(
            f"pull at {speed:g} m/s with teeth of {limit:.3g} N must have a period_s of"
            f" {given(SET.period_widest):.3g} to {given(-SET.period_widest):.3g} s, whatever the wall;"
            f" got {period:.3g} s: are the speed and the rig file's recovery_time_s right, and the forces in N?"
        )
    return float(np.exp(brentq(lambda k: given(k) - period, -SET.period_widest, SET.period_widest)))
