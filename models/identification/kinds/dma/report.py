"""What the report says about a dynamic test: the moduli, what no relaxation law explains, what to measure next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from models.effects.equation import lines_of
from models.files.record import Record
from models.identification.kind import Theta
from models.identification.kinds.dma.common_residual import (
    CommonResidual,
    best_relaxation,
    common_residual,
    springpot_alone,
)
from models.identification.kinds.dma.kind import DmaKind


def equations(kind: DmaKind, theta: Theta) -> list[str]:
    """The moduli in words and numbers."""
    E1, E2, E3, tau1, tau2 = (10 ** theta[f"log10_{n}"] for n in ("E1", "E2", "E3", "tau1", "tau2"))
    out = [
        f"G* = {E3:.4g} + {E1:.4g} iw {tau1:.3g}/(1 + iw {tau1:.3g}) + {E2:.4g} iw {tau2:.3g}/(1 + iw {tau2:.3g}) Pa",
        f"w = 2 pi f, eta1 = {E1 * tau1:.4g} Pa s, eta2 = {E2 * tau2:.4g} Pa s",
    ]
    return [*out, *lines_of(kind.effects, theta)]


def statements(kind: DmaKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences on what no relaxation law explains and what these data cannot tell."""
    theta = theta_by_stage["calibrated"]
    error = kind.error(records, [kind.predict(r, theta) for r in records])
    out = [
        (
            f"The calibrated five-element law leaves {error:.1f} % of the complex modulus; the best of all relaxation"
            f" laws with positive moduli, fitted without restraint, would leave {best_relaxation(kind, records):.1f} %:"
            " a broader spectrum is not what is missing."
        ),
        f"Scatter between samples accounts for {kind.noise_floor(records):.1f} %.",
    ]
    folds = kind.splits(records)
    left_out = np.sqrt(np.mean([springpot_alone(kind, training, validation) ** 2 for training, validation in folds]))
    in_sample = springpot_alone(kind, records, records)
    out.append(
        f"A springpot alone (broad_relaxation, three parameters) leaves {in_sample:.1f} % in sample and "
        f"{left_out:.1f} % left out: fewer parameters, no better."
    )
    common = common_residual(kind, records, theta)
    if common is not None and common.p < 0.01:
        out.append(_common(common))
    out.append(
        "The frequencies span half a decade: the equilibrium spring and the two relaxation times trade against each "
        "other; only the modulus within the band is told."
    )
    return out


def next_experiment(kind: DmaKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What would tell an instrument's resonance from the tissue."""
    return (
        "repeat the sweep in steps of 2 Hz between 30 and 60 Hz with an elastic reference of known modulus and with "
        "samples of another mass and thickness: a dip that stays where it is belongs to the instrument, one that moves "
        "with the sample is inertia"
    )


def _common(common: CommonResidual) -> str:
    lowest = int(np.argmin(common.storage))
    return (
        f"What remains is structured and common to the samples: {100 * common.share:.0f} % of its mean square is the"
        f" same in all of them (F = {common.F:.0f}, p = {common.p:.0e}; by permutation {common.p_permuted:.4f}). The"
        f" storage modulus dips at {common.frequency_Hz[lowest]:g} Hz, {-100 * common.storage[lowest]:.0f} % of the"
        " modulus below the law, and no relaxation law can do that: its storage modulus only grows with frequency. No"
        " known effect explains it."
    )
