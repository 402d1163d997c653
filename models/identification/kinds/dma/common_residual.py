"""What no relaxation law explains in a dynamic test: is it common to the samples, and how low could any law go."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, nnls
from scipy.stats import f as f_distribution

from models.identification.kind import Array
from models.identification.kinds.dma.dma import DmaKind, single_samples
from models.laws.dynamic_modulus import springpot_modulus
from models.records.record import Record
from models.theta import Theta


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
