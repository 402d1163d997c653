"""What the report says about a dynamic test: the moduli, what no relaxation law explains, what to measure next."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy

from models.effects.equation import lines_of
from models.formula import Formula, Line, equal, symbols
from models.identification.finding import Alike
from models.identification.intervals import near
from models.identification.kind import Array
from models.identification.kinds.dma import NAMES, DmaKind, single_samples
from models.identification.settings import SET
from models.laws.five_elements import springpot_modulus
from models.records.record import Record
from models.theta import Theta
from models.words.sentences import Quantity, Sentences

TEXT: Final = Sentences(__file__)


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

    @property
    def largest(self) -> int:
        """Number of the frequency at which it is largest."""
        return int(np.argmax(np.hypot(self.storage, self.loss)))


def common_residual(
    kind: DmaKind, records: Sequence[Record], theta: Theta, permutations: int = 2000
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
    p = float(scipy.special.fdtrc(freedom, freedom * (samples - 1), F))
    p_permuted = (1 + sum(x >= F for x in shuffled)) / (1 + permutations)
    mean = raw.mean(0)
    share = samples * float(np.sum(mean**2)) / float(np.sum(raw**2))
    storage = np.concatenate([kind.measured(r)[:, 0] for r in records])
    frequency = np.concatenate([r["frequency_Hz"] for r in records])
    measured = np.array([storage[frequency == f].mean() for f in shared])
    return CommonResidual(F, p, p_permuted, share, np.array(shared), mean[:, 0], mean[:, 1], measured)


def best_relaxation(kind: DmaKind, records: Sequence[Record]) -> float:
    """Error in % of the best of *all* linear relaxation laws, `G* = E + sum E_i i w tau_i/(1 + i w tau_i) + i w eta`.

    No modulus is negative; 40 branches a decade from 1e-6 to 100 s: no law comes below this error.
    """
    frequency = np.concatenate([r["frequency_Hz"] for r in records])
    measured = np.concatenate([kind.measured(r) for r in records])
    w = 2j * np.pi * frequency[:, None]
    tau = np.logspace(-6, 2, 321)
    G = np.hstack([w * tau / (1 + w * tau), np.ones_like(w), w / np.abs(w).max()])
    scale = float(np.abs(measured).max())
    _, left = scipy.optimize.nnls(np.vstack([G.real, G.imag]), measured.T.ravel() / scale)
    return 100 * float(left) * scale / float(np.linalg.norm(measured))


def springpot_alone(kind: DmaKind, training: Sequence[Record], validation: Sequence[Record]) -> float:
    """Error in % on `validation` of `G* = E + K (i f/10 Hz)^alpha`, three parameters fitted to `training`."""

    def predict(record: Record, q: Array) -> Array:
        law = springpot_modulus(record["frequency_Hz"] / 10, 10 ** q[0], 10 ** q[1], q[2])
        return np.column_stack([law.storage, law.loss])

    def misfit(q: Array) -> Array:
        return np.concatenate([((kind.measured(r) - predict(r, q)) / size).ravel() for r in training])

    size = float(np.mean([np.abs(kind.measured(r)).mean() for r in training]))
    level = np.log10(size)
    fit = scipy.optimize.least_squares(
        misfit, [level - 1, level, 0.3], bounds=([level - 6, level - 6, 0.01], [level + 2, level + 2, 0.99])
    )
    return kind.error(validation, [predict(r, fit.x) for r in validation])


def _table(kind: DmaKind, record: Record, theta: Theta) -> dict[float, Array]:
    measured = kind.measured(record)
    relative = (measured - kind.predict(record, theta)) / np.hypot(*measured.T)[:, None]
    frequency = record["frequency_Hz"]
    return {float(f): relative[frequency == f].mean(0) for f in np.unique(frequency)}


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
    """On the best of all relaxation laws, the samples, a springpot, the residual, and what these data identify."""
    theta = theta_by_stage["calibrated"]
    error = kind.error(records, [kind.predict(r, theta) for r in records])
    floor, best = kind.noise_floor(records), best_relaxation(kind, records)
    if error <= SET.little * max(best, floor):
        meaning = TEXT("dma_narrow")
    else:
        meaning = TEXT("dma_broad" if best <= SET.little * floor else "dma_partly_broad")
    said = [TEXT("dma_error", error=error, best=best, meaning=meaning), TEXT("dma_scatter", floor=floor)]
    said.append(_springpot(kind, error, records))
    common = common_residual(kind, records, theta)
    if common is not None and common.p < SET.significant:
        said += _common(common)
    return [*said, *_at_bounds(kind, theta_by_stage), _relaxation_times(theta, records)]


def _springpot(kind: DmaKind, five: float, records: Sequence[Record]) -> str:
    """A springpot against the five elements' error `five` in % on the records, and both on data held out."""
    folds = [(training, validation) for training, validation in kind.splits(records) if training]
    inside = springpot_alone(kind, records, records)
    if not folds:
        return TEXT("dma_springpot_inside", inside=inside)
    outside = np.sqrt(np.mean([springpot_alone(kind, training, validation) ** 2 for training, validation in folds]))
    better, worse = inside * SET.little < five, inside > SET.little * five
    compared = "better" if better else "worse" if worse else "no better"
    return TEXT("dma_springpot", inside=inside, outside=float(outside), five=five, compared=compared)


def _at_bounds(kind: DmaKind, theta_by_stage: Mapping[str, Theta]) -> list[str]:
    """Moduli and times that a fit moved to a bound, beyond which they would have gone."""
    out = []
    for stage in ("calibrated", "augmented"):
        theta = theta_by_stage.get(stage, Theta())
        at = [
            TEXT("dma_element", name=name, bound=Quantity(10**bound, p.unit.removeprefix("log10 ")))
            for name, p in zip(NAMES, kind.base, strict=True)
            for bound in (p.lower, p.upper)
            if p.name in theta and near(theta[p.name], bound, p)
        ]
        if at:
            out.append(TEXT("dma_bounds", stage=stage, elements=at))
    return out


def _relaxation_times(theta: Theta, records: Sequence[Record]) -> str:
    """Which of the relaxation times lie within the frequencies measured."""
    low, high = _band(records)
    times = {name: 10 ** theta[f"log10_{name}"] for name in ("tau1", "tau2")}
    corners = {name: 1 / (2 * np.pi * tau) for name, tau in times.items()}
    outside = [TEXT("dma_time", name=n, time=times[n], frequency=f) for n, f in corners.items() if not low <= f <= high]
    key = "dma_outside" if outside else "dma_inside"
    return TEXT(key, decades=float(np.log10(high / low)), low=low, high=high, times=outside, count=len(outside))


def _band(records: Sequence[Record]) -> tuple[float, float]:
    frequency = np.concatenate([r["frequency_Hz"] for r in records])
    return float(frequency.min()), float(frequency.max())


def next_experiment(kind: DmaKind, theta: Theta, records: Sequence[Record], _: Alike) -> str | None:
    """A sweep about a frequency that stands out, else wider or denser; None where the samples scatter as much."""
    if not records:
        return None
    common = common_residual(kind, records, theta)
    if common is not None and common.p < SET.significant:
        where, k = common.frequency_Hz, common.largest
        first, last = where[max(k - 1, 0)], where[min(k + 1, len(where) - 1)]
        return TEXT("dma_repeat", first=first, last=last, most=where[k])
    if kind.error(records, [kind.predict(r, theta) for r in records]) <= SET.little * kind.noise_floor(records):
        return None
    low, high = _band(records)
    return TEXT("dma_widen", low=low / 10, high=high * 10)


def _common(common: CommonResidual) -> list[str]:
    said = TEXT("dma_common", share=common.share, F=common.F, p=common.p, p_permuted=common.p_permuted)
    storage, loss, measured = common.storage, common.loss, common.measured
    k = int(np.argmin(storage))
    if 0 < k < len(storage) - 1 and storage[k] < -SET.dma_dip and measured[k] < measured[k - 1]:
        return [said, TEXT("dma_dip", frequency=common.frequency_Hz[k], depth=-storage[k])]
    k = common.largest
    frequency = common.frequency_Hz[k]
    return [said, TEXT("dma_largest", frequency=frequency, storage=100 * storage[k], loss=100 * loss[k])]
