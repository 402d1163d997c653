"""What the report says about a dynamic test: the moduli, what no relaxation law explains, what to measure next."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, nnls
from scipy.stats import f as f_distribution

from models.effects.equation import lines_of
from models.formula import Formula, Line, equal, symbols
from models.identification.fitting.confidence import near
from models.identification.kind import Array
from models.identification.kinds.dma import DmaKind, single_samples
from models.identification.settings import SET
from models.laws.five_elements import springpot_modulus
from models.records.record import Record
from models.theta import Theta


def equations(kind: DmaKind, theta: Theta) -> list[Line]:
    """The complex modulus: a spring and two Maxwell branches of viscosity `eta = E tau`."""
    E_1, E_2, E_3, tau_1, tau_2 = (
        Formula.of(10 ** theta[f"log10_{name}"]) for name in ("E1", "E2", "E3", "tau1", "tau2")
    )
    G, i, omega, f, eta_1, eta_2 = symbols("G i omega f eta_1 eta_2")
    first, second = (E * (i * omega * tau) / (1 + i * omega * tau) for E, tau in ((E_1, tau_1), (E_2, tau_2)))
    return [
        [equal(G, E_3 + first + second), ", ", equal(omega, math.tau * f)],
        [equal(eta_1, E_1 * tau_1), ", ", equal(eta_2, E_2 * tau_2)],
        *lines_of(kind.effects, theta),
    ]


def statements(kind: DmaKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on what no relaxation law explains and what these data cannot tell."""
    theta = theta_by_stage["calibrated"]
    error = kind.error(records, [kind.predict(r, theta) for r in records])
    floor, best = kind.noise_floor(records), best_relaxation(kind, records)
    out = [
        (
            f"The calibrated five-element law leaves {error:.1f} % of the complex modulus; the best of all relaxation"
            f" laws with positive moduli, fitted without restraint, would leave {best:.1f} %:"
            f" {_broader(error, best, floor)}"
        ),
        f"Scatter between samples accounts for {floor:.1f} %.",
    ]
    out += _springpot(kind, theta, records)
    common = common_residual(kind, records, theta)
    if common is not None and common.p < SET.significant:
        out.append(_common(common))
    return [*out, *_stopped(kind, theta_by_stage), _told(theta, records)]


def _broader(error: float, best: float, floor: float) -> str:
    """What the least error of any relaxation law says about the five elements'."""
    if error <= SET.little * max(best, floor):
        return "a broader spectrum is not what is missing."
    if best <= SET.little * floor:
        return "a broader spectrum is all that is missing."
    return "a broader spectrum takes away part of it and leaves the rest."


def _springpot(kind: DmaKind, theta: Theta, records: Sequence[Record]) -> list[str]:
    """A springpot against the five elements, both fitted here and both on data left out, as the numbers have it."""
    folds = [(training, validation) for training, validation in kind.splits(records) if training]
    inside = springpot_alone(kind, records, records)
    five = kind.error(records, [kind.predict(r, theta) for r in records])
    if not folds:
        return [f"A springpot alone (three parameters) leaves {inside:.1f} % in sample."]
    left = float(np.sqrt(np.mean([springpot_alone(kind, training, validation) ** 2 for training, validation in folds])))
    return [
        f"A springpot alone (broad_relaxation, three parameters) leaves {inside:.1f} % in sample and {left:.1f} % left"
        f" out, the five elements {five:.1f} % in sample: fewer parameters, {_compared(inside, five)}."
    ]


def _compared(error: float, other: float) -> str:
    return "better" if error * SET.little < other else "worse" if error > SET.little * other else "no better"


def _stopped(kind: DmaKind, theta_by_stage: Mapping[str, Theta]) -> list[str]:
    """Moduli and times that a fit moved to a bound, where they would have gone further."""
    out = []
    for stage in ("calibrated", "augmented"):
        theta = theta_by_stage.get(stage, Theta())
        at = [
            f"{p.name.removeprefix('log10_')} at {10**bound:.3g} {p.unit.removeprefix('log10 ')}"
            for p in kind.base
            for bound in (p.lower, p.upper)
            if p.name in theta and near(theta[p.name], bound, p)
        ]
        if at:
            out.append(
                f"The {stage} fit stops at bounds: {', '.join(at)}. Such an element is no measurement; as far as these"
                " frequencies tell it may be left out or be beyond what a wall is believed to have."
            )
    return out


def _told(theta: Theta, records: Sequence[Record]) -> str:
    """Which of the relaxation times lie within the frequencies measured."""
    low, high = _band(records)
    times = {name: 10 ** theta[f"log10_{name}"] for name in ("tau1", "tau2")}
    corners = {name: 1 / (2 * np.pi * tau) for name, tau in times.items()}
    outside = [f"{name} ({times[name]:.2g} s, {f:.2g} Hz)" for name, f in corners.items() if not low <= f <= high]
    span = f"The frequencies span {_decades(low, high)}, {low:g} to {high:g} Hz"
    if not outside:
        return f"{span}; both relaxation times lie within them and are identifiable."
    return (
        f"{span}; {' and '.join(outside)} lie{'s' if len(outside) == 1 else ''} beyond them: the equilibrium spring and"
        " such times trade against each other, only the modulus within the band is identifiable."
    )


def _band(records: Sequence[Record]) -> tuple[float, float]:
    frequency = np.concatenate([r["frequency_Hz"] for r in records])
    return float(frequency.min()), float(frequency.max())


def _decades(low: float, high: float) -> str:
    decades = np.log10(high / low)
    return "half a decade" if abs(decades - 0.5) < 0.05 else f"{decades:.1f} decades"


def next_experiment(kind: DmaKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """A sweep about a frequency that stands out, else wider or denser; None where the samples scatter as much."""
    if not records:
        return None
    low, high = _band(records)
    common = common_residual(kind, records, theta)
    if common is not None and common.p < SET.significant:
        where = common.frequency_Hz
        k = int(np.argmax(np.hypot(common.storage, common.loss)))
        first, last = where[max(k - 1, 0)], where[min(k + 1, len(where) - 1)]
        return (
            f"repeat the sweep in ten steps between {first:g} and {last:g} Hz, about {where[k]:g} Hz where most is"
            " left, with an elastic reference of known modulus and with samples of another mass and thickness: what"
            " stays where it is belongs to the instrument, what moves with the sample is inertia"
        )
    if kind.error(records, [kind.predict(r, theta) for r in records]) <= SET.little * kind.noise_floor(records):
        return None
    return (
        f"sweep from {low / 10:.2g} to {high * 10:.2g} Hz, five frequencies a decade, two samples or more: the moduli"
        " beyond today's frequencies tell the equilibrium spring and the relaxation times apart, the samples tell what"
        " is the tissue's"
    )


def _common(common: CommonResidual) -> str:
    lowest = int(np.argmin(common.storage))
    said = (
        f"What remains is structured and common to the samples: {100 * common.share:.0f} % of its mean square is the"
        f" same in all of them (F = {common.F:.0f}, p = {common.p:.0e}; by permutation {common.p_permuted:.4f})."
    )
    middle = 0 < lowest < len(common.storage) - 1
    if middle and common.storage[lowest] < -SET.dma_dip and common.measured[lowest] < common.measured[lowest - 1]:
        return (
            f"{said} The storage modulus dips at {common.frequency_Hz[lowest]:g} Hz,"
            f" {-100 * common.storage[lowest]:.0f} % of the modulus below the law, and no relaxation law can do that:"
            " its storage modulus only grows with frequency. No known effect explains it."
        )
    most = int(np.argmax(np.hypot(common.storage, common.loss)))
    return (
        f"{said} It is largest at {common.frequency_Hz[most]:g} Hz: storage {100 * common.storage[most]:+.0f} %, loss"
        f" {100 * common.loss[most]:+.0f} % of the modulus beside the law."
    )


@dataclass(frozen=True)
class CommonResidual:
    """Test of "the residual changes with frequency alike in all samples".

    F ratio, its chance `p` and the permuted one, the share of the residual's mean square that is common, the
    frequencies in Hz, the common relative error of storage and loss modulus at each, and the measured storage modulus
    in Pa there.
    """

    F: float
    p: float
    p_permuted: float
    share: float
    frequency_Hz: Array
    storage: Array
    loss: Array
    measured: Array


def common_residual(
    kind: DmaKind, records: Sequence[Record], theta: Theta, permutations: int = 2000, seed: int = 0
) -> CommonResidual | None:
    """Two-way analysis of variance of the relative residual: frequencies against the remainder beside each sample's
    mean.

    None with fewer than two samples or three shared frequencies. The permuted `p` shuffles the frequencies within
    samples.
    """
    tables = [_table(kind, r, theta) for record in records for r in single_samples(record)]
    shared = sorted(set.intersection(*(set(t) for t in tables)))
    if len(tables) < 2 or len(shared) < 3:
        return None
    raw = np.array([[t[f] for f in shared] for t in tables])  # sample, frequency, (storage, loss)
    e = raw - raw.mean(1, keepdims=True)
    samples, frequencies = e.shape[:2]

    def ratio(x: Array) -> float:
        between = samples * float(np.sum(x.mean(0) ** 2))
        within = float(np.sum((x - x.mean(0)) ** 2))
        return float(between * (samples - 1) / max(within, 1e-300))

    F = ratio(e)
    freedom = 2 * (frequencies - 1)
    rng = np.random.default_rng(0)
    shuffled = [ratio(np.stack([s[rng.permutation(frequencies)] for s in e])) for _ in range(permutations)]
    p = float(f_distribution.sf(F, freedom, freedom * (samples - 1)))
    p_permuted = (1 + sum(x >= F for x in shuffled)) / (1 + permutations)
    mean = raw.mean(0)
    share = samples * float(np.sum(mean**2)) / float(np.sum(raw**2))
    storage = np.concatenate([kind.measured(r)[:, 0] for r in records])
    frequency = np.concatenate([r["frequency_Hz"] for r in records])
    measured = np.array([storage[frequency == f].mean() for f in shared])
    return CommonResidual(F, p, p_permuted, share, np.array(shared), mean[:, 0], mean[:, 1], measured)


def best_relaxation(kind: DmaKind, records: Sequence[Record]) -> float:
    """Error in % of the best of *all* linear relaxation laws, `G* = E + sum E_i i w tau_i/(1 + i w tau_i) + i w eta`.

    No modulus negative, 40 branches a decade from 1e-6 to 100 s, fitted without restraint: a bound below which no law
    gets.
    """
    frequency = np.concatenate([r["frequency_Hz"] for r in records])
    measured = np.concatenate([kind.measured(r) for r in records])
    w = 2j * np.pi * frequency[:, None]
    tau = np.logspace(-6, 2, 321)
    G = np.hstack([w * tau / (1 + w * tau), np.ones_like(w), w / np.abs(w).max()])
    scale = float(np.abs(measured).max())
    _, left = nnls(np.vstack([G.real, G.imag]), measured.T.ravel() / scale)
    return 100 * float(left) * scale / float(np.linalg.norm(measured))


def springpot_alone(kind: DmaKind, training: Sequence[Record], validation: Sequence[Record]) -> float:
    """Error in % on `validation` of `G* = E + K (i f/10 Hz)^alpha`, three parameters fitted to `training`."""

    def predict(records: Sequence[Record], q: Array) -> list[Array]:
        out = []
        for r in records:
            law = springpot_modulus(r["frequency_Hz"] / 10, 10 ** q[0], 10 ** q[1], q[2])
            out.append(np.column_stack([law.storage, law.loss]))
        return out

    def misfit(q: Array) -> Array:
        pairs = zip(training, predict(training, q), strict=True)
        return np.concatenate([((kind.measured(r) - p) / size).ravel() for r, p in pairs])

    size = float(np.mean([np.abs(kind.measured(r)).mean() for r in training]))
    level = np.log10(size)
    fit = least_squares(
        misfit, [level - 1, level, 0.3], bounds=([level - 6, level - 6, 0.01], [level + 2, level + 2, 0.99])
    )
    return kind.error(validation, predict(validation, fit.x))


def _table(kind: DmaKind, record: Record, theta: Theta) -> dict[float, Array]:
    measured = kind.measured(record)
    relative = (measured - kind.predict(record, theta)) / np.hypot(*measured.T)[:, None]
    frequency = record["frequency_Hz"]
    return {float(f): relative[frequency == f].mean(0) for f in np.unique(frequency)}
