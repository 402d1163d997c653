"""What the report says about stick-slip periods: the cycle in numbers, what the speeds show, what to measure next."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import scipy

from models.effects.equation import LEFT, lines_of
from models.formula import Formula, Line, called, equal, symbols
from models.identification.finding import STAGES, Alike
from models.identification.kind import Array
from models.identification.kinds.periods import PeriodsKind
from models.identification.settings import SET
from models.records.record import Record, named
from models.theta import Theta
from models.words.quantities import quantity
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)


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
    """On the error of each stage, and on what these speeds identify."""
    speeds = kind.speeds_of(records)
    out = []
    for stage in (stage for stage in STAGES if stage in theta_by_stage):
        for v in map(float, speeds):
            predicted = _means(kind, records, v, theta_by_stage[stage])
            period, valley, peak = 100 * (predicted / _means(kind, records, v) - 1)
            key = "periods_off_at" if len(speeds) > 1 else "periods_off"
            off = {"period": float(predicted[0]), "period_off": period, "valley": valley, "peak": peak}
            out.append(TEXT(key, stage=stage.capitalize(), speed=v, **off))
    theta = theta_by_stage["calibrated"]
    return out + (_one_speed(kind, theta, records) if len(speeds) == 1 else _several_speeds(kind, theta, records))


def _one_speed(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> list[str]:
    v = float(kind.speeds_of(records)[0])
    period = float(_means(kind, records, v)[0])
    limit, rise = kind.levels(v, theta)[1], kind.cycle(v, theta).tooth
    as_paper, length = replace(kind, return_speed_m_s=SET.return_m_s), kind.capsule.cylinder_length_m
    printed, short = (_period(k, 0.01656, SET.pull_m_s) for k in (as_paper, replace(as_paper, length_m=length)))
    with named(records[0]):
        stiffer = _stiffer_by(kind, limit, period, v)
    drag, shorter = rise.drag_m / stiffer, kind.length_m / stiffer
    out = [
        TEXT("periods_paper", length=length, printed=printed, short=short),
        TEXT("periods_confounded", factor=stiffer, drag=drag, shorter=shorter, length=kind.length_m),
    ]
    if rise.rise_s > period:
        out.append(TEXT("periods_recovery", rise=rise.rise_s, period=period))
    return out


def _several_speeds(kind: PeriodsKind, theta: Theta, records: Sequence[Record]) -> list[str]:
    """How period and travel per period change from the slowest to the fastest pull, measured and calibrated."""
    speeds = kind.speeds_of(records)
    slow, fast = float(speeds[0]), float(speeds[-1])
    (first, low, _), (last, high, top) = (map(float, _means(kind, records, v)) for v in (slow, fast))
    begin, end = (kind.cycle(v, theta) for v in (slow, fast))
    return [
        TEXT(
            "periods_speeds",
            slow=slow,
            fast=fast,
            first=first,
            last=last,
            ratio=last / first,
            model_first=begin.tooth.period_s,
            model_last=end.tooth.period_s,
            model_ratio=end.tooth.period_s / begin.tooth.period_s,
            valley=high / low,
            model_valley=end.valley / begin.valley,
        ),
        TEXT(
            "periods_travel",
            slow=slow,
            fast=fast,
            slow_travel=slow * first,
            fast_travel=fast * last,
            height=top - high,
            drag=kind.tooth(top - high, fast, theta).drag_m,
        ),
        TEXT("periods_specimens"),
    ]


def next_experiment(kind: PeriodsKind, theta: Theta, records: Sequence[Record], _: Alike) -> str | None:
    """What would separate a stiffer wall from a shorter or viscous one; with several speeds, time from space."""
    speeds = kind.speeds_of(records)
    if len(speeds) > 1:
        between = np.geomspace(float(speeds[0]), float(speeds[-1]), 5)
        return TEXT("periods_fold", speeds=[str(Quantity(float(f"{v:.2g}"), "m/s")) for v in between])
    v = kind.velocity_m_s
    return TEXT("periods_vary", low=v / 5, high=v * 20)


def _means(kind: PeriodsKind, records: Sequence[Record], speed: float, theta: Theta | None = None) -> Array:
    """Mean period, valley and peak (3,) at a speed, measured or, with `theta`, predicted."""
    rows = [kind.measured(r) if theta is None else kind.predict(r, theta) for r in records]
    at = [np.abs(r.columns.get("velocity_m_s", np.full(len(r), speed))) == speed for r in records]
    return np.asarray(np.concatenate([row[here] for row, here in zip(rows, at, strict=True)]).mean(0))


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
    return float(np.exp(scipy.optimize.brentq(lambda k: given(k) - period, -SET.period_widest, SET.period_widest)))
