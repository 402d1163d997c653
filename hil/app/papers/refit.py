"""Least squares of relaxation laws on dynamic moduli, and their error on data left out."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from models.laws.five_elements import DynamicModulus, maxwell_branch, springpot_modulus

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class Spectrum:
    """A law `Y = sum_k a_k basis_k(omega; shape)`, a_k >= 0 in Pa: linear in its moduli, nonlinear in a few shape
    numbers.
    """

    name: str
    basis: Callable[[Real, Real], Complex]
    starts: tuple[tuple[float, ...], ...]

    def weights(self, shape: Real, omega: Real, target: Complex) -> tuple[Real, float]:
        """Best non-negative moduli at a given shape and what is left, `||Y - Y_law||` in Pa."""
        columns = self.basis(omega, shape)
        left, residual = scipy.optimize.nnls(
            np.vstack([columns.real, columns.imag]), np.concatenate([target.real, target.imag])
        )
        return left, float(residual)


@dataclass(frozen=True)
class FittedSpectrum:
    """A fitted spectrum; call it with omega in rad/s for the complex modulus in Pa."""

    law: Spectrum
    shape: Real
    moduli: Real

    def __call__(self, omega: Real) -> Complex:
        return self.law.basis(omega, self.shape) @ self.moduli


def _pair(y: DynamicModulus) -> Complex:
    return np.asarray(y.storage + 1j * y.loss)


def _five_basis(omega: Real, shape: Real) -> Complex:
    branches = [_pair(maxwell_branch(omega, 1.0, time)) for time in np.exp(shape)]
    return np.stack([*branches, np.ones_like(omega, dtype=complex)], axis=-1)


def _springpot_basis(omega: Real, shape: Real) -> Complex:
    order = float(np.clip(shape[0], 0.0, 1.0))
    return np.stack([_pair(springpot_modulus(omega, 0.0, 1.0, order)), np.ones_like(omega, dtype=complex)], axis=-1)


_TIMES = np.log(np.geomspace(3e-4, 0.3, 7)).tolist()
FIVE_ELEMENTS = Spectrum("five elements", _five_basis, tuple(itertools.combinations(_TIMES, 2)))
SPRINGPOT = Spectrum("springpot", _springpot_basis, tuple((order,) for order in (0.1, 0.3, 0.5, 0.7, 0.9)))


def fit_spectrum(law: Spectrum, omega: Real, target: Complex) -> FittedSpectrum:
    """The law that minimises `||Y - Y_law||` over samples and frequencies; `omega` in rad/s and `target` in Pa, same
    shape (n,).

    The moduli are solved for exactly at each shape (variable projection), the shape is searched from the best start.
    """

    def cost(shape: Real) -> float:
        return law.weights(shape, omega, target)[1] / float(np.linalg.norm(target))

    best = min(law.starts, key=lambda start: cost(np.array(start)))
    found = scipy.optimize.minimize(cost, np.array(best), method="Nelder-Mead", options={"xatol": 1e-6, "fatol": 1e-10})
    shape = np.asarray(found.x)
    return FittedSpectrum(law, shape, law.weights(shape, omega, target)[0])


def relative_error(model: Complex, target: Complex) -> float:
    """`||model - target||/||target||` over all values."""
    return float(np.linalg.norm(model - target) / np.linalg.norm(target))


def left_out_error(law: Spectrum, omega: Real, target: Complex, group: Real) -> float:
    """Mean over the groups of the relative error on a group that the fit has not seen."""
    errors = []
    for value in np.unique(group):
        out = group == value
        errors.append(relative_error(fit_spectrum(law, omega[~out], target[~out])(omega[out]), target[out]))
    return float(np.mean(errors))
