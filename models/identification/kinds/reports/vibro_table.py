"""What the report says about a table of mean speeds: its equations, what the data leave open, what to measure next."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from models.effects import effect_words
from models.effects.equation import lines_of
from models.formula import Line, called, equal, symbols
from models.identification.finding import Alike
from models.identification.fitting.fitter import Fitter
from models.identification.kinds.table import distinct
from models.identification.kinds.vibro_table import VibroTableKind
from models.identification.settings import SET
from models.laws.geometry import GRAVITY
from models.records.record import Record
from models.rigs.benches import VIBRO_TABLE
from models.theta import Theta
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
_LAGS: Final = (("coil_lag", "time_s"), ("actuator_lag", "time_s"))
_REACH: Final = ("coil_reach", "gain_per_m")


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


def statements(kind: VibroTableKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """On what was found, what these data cannot identify, and the residual."""
    theta, nominal = theta_by_stage.get("augmented") or theta_by_stage["calibrated"], kind.nominal()
    out = [TEXT("vibro_sign", direction="along" if nominal["mirror"] > 0 else "against")]
    repeats = float(np.sqrt(max(kind.noise_floor(records) ** 2 - kind.model_error_m_s**2, 0.0)))
    out.append(TEXT("vibro_noise", repeats=repeats, setup=kind.model_error_m_s))
    for stage, values in theta_by_stage.items():
        at = {duty: reversal(kind, values, duty) for duty in SET.duties}
        turns = [TEXT("vibro_turn_at", period=t, duty=d) if t else TEXT("vibro_never", duty=d) for d, t in at.items()]
        out.append(TEXT("vibro_turn", stage=stage, turns=turns))
    scale = theta.get("load_scale", 1.0)
    force, friction = (scale * theta[k] / nominal[k] for k in ("force_N", "friction_coefficient"))
    if min(force, friction) > SET.both_off or max(force, friction) < 1 / SET.both_off:
        out.append(TEXT("vibro_scale", force=force, friction=friction))
    if _REACH in theta:
        rest, near, far = (scale * theta["force_N"] * np.exp(theta[_REACH] * xi) for xi in (0.0, 0.01, 0.02))
        out.append(TEXT("vibro_reach", rest=rest, near=near, far=far, nominal=nominal["force_N"]))
    if any(lag in theta for lag in _LAGS):
        out.append(TEXT("vibro_lag"))
    ends = [
        TEXT("vibro_parameter", name=p.name, value=theta[p.name])
        for p in kind.base
        if p.fit
        and p.name in theta
        and min(theta[p.name] - p.lower, p.upper - theta[p.name]) < SET.at_bound * (p.upper - p.lower)
    ]
    if ends:
        out.append(TEXT("vibro_bounds", parameters=ends))
    return [*out, *_validation(kind, theta, records), *_runs(kind, theta, records)]


def next_experiment(kind: VibroTableKind, theta: Theta, records: Sequence[Record], alike: Alike) -> str | None:
    wishes, theta = [], theta.only([name for name in theta.effects if alike.get(name)])
    if ("spring_damping", "damping_N_s_per_m") in theta or ("guide_friction", "friction_N") in theta:
        wishes.append(TEXT("vibro_ring_down"))
    if any(name in theta for name in (*_LAGS, _REACH)):
        wishes.append(TEXT("vibro_coil"))
    return "; ".join([*wishes, TEXT("vibro_balance")]) if wishes else None


def reversal(kind: VibroTableKind, theta: Theta, duty: float = 0.3) -> float | None:
    """The period in s, in 0.05 to 0.1, at which the mean velocity at `duty` changes sign; None where none does."""
    periods = np.arange(0.05, 0.1001, 0.0005)
    columns = {"period_s": periods, "duty": np.full(len(periods), duty), "cycles": np.full(len(periods), 50.0)}
    speeds = kind.predict(Record("runs", VIBRO_TABLE.id, columns), theta)
    at = np.flatnonzero(speeds[:-1] * speeds[1:] < 0)
    if len(at) == 0:
        return None
    i = int(at[-1])
    return float(periods[i] + 0.0005 * speeds[i] / (speeds[i] - speeds[i + 1]))


def _validation(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> Iterator[str]:
    errors = cross_validated(kind, theta, records)
    if errors:
        yield TEXT("vibro_validated", error=errors.pop(""))
    if errors:
        words = {effect_words(name, kind.catalogue): error for name, error in errors.items()}
        yield TEXT("vibro_without", errors=[TEXT("vibro_error_without", error=e, effect=n) for n, e in words.items()])


def _runs(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> Iterator[str]:
    """The worst run, and by how much repeats differ."""
    columns = ("period_s", "duty", kind.quantity)
    period, duty, speed = (np.concatenate([record[name] for record in records]) for name in columns)
    error = np.concatenate([kind.predict(record, theta) for record in records]) - speed
    k = int(np.argmax(np.abs(error)))
    yield TEXT("vibro_worst", error=float(error[k]), period=float(period[k]), duty=float(duty[k]))
    spread = []
    for r in records:
        _, index = distinct(np.column_stack((r["period_s"], r["duty"])))
        spread += [float(np.ptp(r[kind.quantity][index == i])) for i in range(int(index.max()) + 1)]
    yield TEXT("vibro_repeats", spread=max(spread))


def cross_validated(kind: VibroTableKind, theta: Theta, records: Sequence[Record]) -> dict[str, float]:
    """Rms error in m/s over conditions, each predicted by a fit to the parts (`kind.splits`) that do not hold it.

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
        squares = []
        for training, held in splits:
            fitted = theta.without(left_out)
            for secant in (0.3, 0.1) if left_out else (0.1,):
                fitter = Fitter.of(kind, training, list(fitted.effects), 0)
                fitted = fitter.near(fitted, [secant], SET.table_steps).theta
            squares += [kind.errors(r, kind.predict(r, fitted)) ** 2 for r in held]
        out[left_out] = float(np.sqrt(np.mean(np.concatenate(squares))))
    return out
