"""What the report says about a table of mean speeds: its equations, what the data cannot tell, what to measure next."""

from collections.abc import Mapping, Sequence

import numpy as np

from models.effects.equation import lines_of
from models.formula import Line, called, equal, symbols
from models.identification.fitting.fit import Problem
from models.identification.kind import Array
from models.identification.kinds.vibro_table.solver import GRAVITY
from models.identification.kinds.vibro_table.vibro_table import VibroTableKind
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.benches import VIBRO_TABLE
from models.theta import Theta


def equations(kind: VibroTableKind, theta: Theta) -> list[Line]:
    """The model, SI units, then each effect; `xi` is the inner mass's displacement."""
    theta = kind.nominal() | theta
    body, inner = theta["body_mass_kg"], theta["inner_mass_kg"]
    force, grip = (theta.get("load_scale", 1.0) * theta[name] for name in ("force_N", "friction_coefficient"))
    v, rate, xi, relative, S, F, t = symbols("v v' xi xi'' S F t")
    R, direction = called("R", v), called("Sgn", v)
    sign = "" if theta["mirror"] > 0 else "minus "
    return [
        [equal(body * rate, S - F - R)],
        [equal(inner * (rate + relative), F - S)],
        [equal(S, theta["spring_stiffness_N_per_m"] * xi)],
        [equal(F, force * called("on", t))],
        [equal(R, grip * (body + inner) * GRAVITY * direction), ", ", equal(called("Sgn", 0), called("[]", -1, 1))],
        [f"mean velocity in the record: {sign}the mean of ", v, " over the run, from rest"],
        *lines_of(kind.effects, theta),
    ]


def reversal(kind: VibroTableKind, theta: Theta, duty: float = 0.3) -> float | None:
    """The period in s, in 0.05 to 0.1, at which the mean velocity at `duty` changes sign; None where none does."""
    periods = np.arange(0.05, 0.1001, 0.0005)
    speeds = kind.predict(_runs(periods, duty), theta)
    at = np.flatnonzero(speeds[:-1] * speeds[1:] < 0)
    if len(at) == 0:
        return None
    i = int(at[-1])
    return float(periods[i] + 0.0005 * speeds[i] / (speeds[i] - speeds[i + 1]))


def _runs(periods: Array, duty: float) -> Record:
    columns = {"period_s": periods, "duty": np.full(len(periods), duty), "cycles": np.full(len(periods), 50.0)}
    return Record("runs", VIBRO_TABLE.id, columns)


def statements(kind: VibroTableKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on what was found, what these data cannot tell, and what remains."""
    theta = theta_by_stage.get("augmented") or theta_by_stage["calibrated"]
    nominal = kind.nominal()
    out = [
        (
            f"The record counts velocities {'along' if nominal['mirror'] > 0 else 'against'} the coil's push on the"
            " inner mass."
        ),
        *(_turn(kind, stage, values) for stage, values in theta_by_stage.items()),
    ]
    scale = theta.get("load_scale", 1.0)
    force, friction = (scale * theta[k] / nominal[k] for k in ("force_N", "friction_coefficient"))
    if min(force, friction) > SET.both_off or max(force, friction) < 1 / SET.both_off:
        out.append(
            f"Force and friction come out at {force:.2f} and {friction:.2f} times nominal. A common factor on both,"
            " load_scale, scales every speed by it and little else, so these data hardly tell it from a scale error of"
            " the displacement; the ratio of force to friction is what they fix."
        )
    if ("coil_reach", "gain_per_m") in theta:
        at = [scale * theta["force_N"] * np.exp(theta["coil_reach", "gain_per_m"] * xi) for xi in (0.0, 0.01, 0.02)]
        out.append(
            f"The coil pushes with {at[0]:.2f} N on the inner mass at rest, with {at[1]:.2f} N at 10 mm and {at[2]:.2f}"
            f" N at 20 mm; the nominal {nominal['force_N']:.3g} N must not be compared with the first of these alone."
        )
    if ("coil_lag", "time_s") in theta or ("actuator_lag", "time_s") in theta:
        out.append(
            "The measured speeds at duty D and 1 - D are not mirrored: the drive acts for less time than it is switched"
            " on. A lagging current whose square makes the force does this; a lagging force by itself does not."
        )
    return [
        *out,
        *_at_bounds(kind, theta),
        *_validation(kind, theta, records),
        _worst(kind, theta, records),
        _sessions(records),
    ]


def _at_bounds(kind: VibroTableKind, theta: Theta) -> list[str]:
    """Which fitted base values lie at the end of what was believed, so that they are not measured."""
    ends = [
        f"{p.name} = {theta[p.name]:.3g}"
        for p in kind.base
        if p.fit
        and p.name in theta
        and min(theta[p.name] - p.lower, p.upper - theta[p.name]) < SET.at_bound * (p.upper - p.lower)
    ]
    return [f"At the end of their believed range, so not measured by these data: {', '.join(ends)}."] if ends else []


def _validation(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> list[str]:
    errors = cross_validated(kind, theta, records)
    if not errors:
        return []
    said = (
        "Cross-validated by whole conditions (eight parts, repeats of a condition never split) the model is off by "
        f"{1e3 * errors.pop(''):.2f} mm/s rms"
    )
    without = ", ".join(f"{1e3 * error:.2f} without {name}" for name, error in errors.items())
    return [f"{said}; refitted with one effect less: {without} (mm/s)." if without else f"{said}."]


def _turn(kind: VibroTableKind, stage: str, theta: Theta) -> str:
    turns = [reversal(kind, theta, duty) for duty in SET.duties]
    said = ", ".join(
        f"{1e3 * t:.1f} ms at duty {d:g}" if t else f"never at duty {d:g}"
        for t, d in zip(turns, SET.duties, strict=True)
    )
    return f"The {stage} model reverses direction between 50 and 100 ms: {said}."


def _worst(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> str:
    rows = [
        (abs(e), r["period_s"][i], r["duty"][i], e)
        for r in records
        for i, e in enumerate(kind.predict(r, theta) - r[kind.quantity])
    ]
    _, period, duty, error = max(rows)
    return (
        f"The largest error of a single run is {1e3 * error:+.1f} mm/s, at a period of {1e3 * period:.0f} ms and duty"
        f" {duty:g}."
    )


def _sessions(records: Sequence[Record]) -> str:
    spread = []
    for r in records:
        _, index = np.unique(np.column_stack((r["period_s"], r["duty"])), axis=0, return_inverse=True)
        spread += [float(np.ptp(r["mean_velocity_m_s"][index.ravel() == i])) for i in range(int(index.max()) + 1)]
    return (
        f"Repeats of one condition differ by up to {1e3 * max(spread):.1f} mm/s, so more than that is not the model's"
        " to explain."
    )


def next_experiment(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What to measure to tell equivalents apart."""
    wishes = []
    if ("spring_damping", "damping_N_s_per_m") in theta or ("guide_friction", "friction_N") in theta:
        wishes.append(
            "ring-down of the inner mass with the body held: exponential for damping, straight for dry friction of its"
            " guide"
        )
    if ("coil_lag", "time_s") in theta or ("actuator_lag", "time_s") in theta or ("coil_reach", "gain_per_m") in theta:
        wishes.append("the coil's current on an oscilloscope and its static force over the inner mass's displacement")
    if wishes:
        wishes.append(
            "a pull with a spring balance for the friction, which with the force fixes the scale of all speeds"
        )
    return "; ".join(wishes) or None


def cross_validated(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> dict[str, float]:
    """Rms error in m/s over conditions, each predicted by a fit to the parts (`kind.folds`) that do not hold it.

    Keys: "" for the model with every effect of `theta`, and each effect's id for the model refitted without it. Every
    fit starts from `theta`; which effects there are is not chosen anew in each part. Empty where there are fewer than
    24 conditions.
    """
    splits = kind.splits(records)
    runs = [{pair for r in held for pair in zip(r["period_s"], r["duty"], strict=True)} for _, held in splits]
    if sum(map(len, runs)) < SET.table_fewest:
        return {}
    out = {}
    for left_out in ("", *theta.effects):
        start = theta.without(left_out)
        secants = (0.3, 0.1) if left_out else (0.1,)
        squares = [_squared(kind, held, _fitted(kind, training, start, secants)) for training, held in splits]
        out[left_out] = float(np.sqrt(np.mean(np.concatenate(squares))))
    return out


def _fitted(kind: VibroTableKind, records: Sequence[Record], theta: Theta, secants: Sequence[float]) -> Theta:
    for secant in secants:
        theta = Problem.of(kind, records, list(theta.effects), 0).descend(theta, secant, SET.table_steps).theta
    return theta


def _squared(kind: VibroTableKind, held: Sequence[Record], theta: Theta) -> Array:
    """Squared errors of the conditions of `held`."""
    return np.concatenate([kind.errors(r, kind.predict(r, theta)) ** 2 for r in held])
