"""Paper V's Table 3 against the dynamic moduli of its Table 2, and what other relaxation laws make of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import scipy
from numpy.typing import NDArray

from hil.app.papers.comparison import TEXT, Drawing, Plot, Row, row
from models.laws.five_elements import (
    DynamicModulus,
    Reading,
    angular_frequency,
    five_element_modulus,
    high_speed_moduli,
    maxwell_branch,
    springpot_modulus,
)
from models.parameter import load_set
from models.sets import load_measurement

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
_DIP_HZ: Final = 40.0  # of the modulus in paper V's Table 2


def _complex(y: DynamicModulus) -> Complex:
    return np.asarray(y.storage + 1j * y.loss, dtype=np.complex128)


@dataclass(frozen=True)
class Spectrum:
    """A law `Y = sum_k a_k basis_k(omega; shape)`, a_k >= 0 in Pa."""

    name: str
    basis: Callable[[Real, Real], Complex]
    starts: tuple[tuple[float, ...], ...]

    def weights(self, shape: Real, omega: Real, target: Complex) -> tuple[Real, float]:
        """Best non-negative moduli at a given shape, and the residual `||Y - Y_law||` in Pa."""
        columns = self.basis(omega, shape)
        moduli, residual = scipy.optimize.nnls(
            np.vstack([columns.real, columns.imag]), np.concatenate([target.real, target.imag])
        )
        return moduli, float(residual)


@dataclass(frozen=True)
class FittedSpectrum:
    """A fitted spectrum; call it with omega in rad/s for the complex modulus in Pa."""

    law: Spectrum
    shape: Real
    moduli: Real

    def __call__(self, omega: Real) -> Complex:
        return self.law.basis(omega, self.shape) @ self.moduli


def _five_basis(omega: Real, shape: Real) -> Complex:
    branches = [_complex(maxwell_branch(omega, 1.0, time)) for time in np.exp(shape)]
    return np.stack([*branches, np.ones_like(omega, dtype=complex)], axis=-1)


def _springpot_basis(omega: Real, shape: Real) -> Complex:
    order = float(np.clip(shape[0], 0.0, 1.0))
    return np.stack([_complex(springpot_modulus(omega, 0.0, 1.0, order)), np.ones_like(omega, dtype=complex)], axis=-1)


_TIMES: Final = np.log(np.geomspace(3e-4, 0.3, 7)).tolist()
FIVE_ELEMENTS: Final = Spectrum("five elements", _five_basis, tuple(itertools.combinations(_TIMES, 2)))
SPRINGPOT: Final = Spectrum("springpot", _springpot_basis, tuple((order,) for order in (0.1, 0.3, 0.5, 0.7, 0.9)))


def fit_spectrum(law: Spectrum, omega: Real, target: Complex) -> FittedSpectrum:
    """The law in Pa over omega in rad/s that minimises `||Y - Y_law||` over `omega` (n,) and `target` (n,): the moduli
    are solved for exactly at each shape (variable projection), the shape is searched from the best start.
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


@dataclass(frozen=True)
class DmaTable:
    """Table 2: frequency in Hz, sample number and complex modulus in Pa, each of shape (15,)."""

    frequency: Real
    sample: Real
    modulus: Complex

    @classmethod
    def load(cls) -> DmaTable:
        t = load_measurement("viscoelastic_table2_dma")
        return cls(t["frequency_Hz"], t["sample"], t["storage_modulus_Pa"] + 1j * t["loss_modulus_Pa"])

    def table3(self, reading: Reading) -> Complex:
        """What Table 3's moduli give at the measured frequencies, in Pa."""
        return _complex(five_element_modulus(angular_frequency(self.frequency, reading), high_speed_moduli()))

    @property
    def omega(self) -> Real:
        return np.asarray(angular_frequency(self.frequency))


def best_scale(model: Complex, target: Complex) -> float:
    """The real factor on `model` that minimises `||scale model - target||`."""
    return float(np.real(np.vdot(model, target)) / np.real(np.vdot(model, model)))


def dma_rows() -> Iterator[Row]:
    """What V says of its test: how far the samples differ, and the speed of the shear; then Table 3 and the refits."""
    table, s = DmaTable.load(), load_set("zhang2014_dma_test")
    at_lowest = table.frequency == table.frequency.min()
    for name, rows in (("20_hz", at_lowest), ("largest", np.ones_like(at_lowest))):
        yield row(f"v_dma_deviation_{name}", largest_deviation(table, rows), paper=s["largest_deviation"])
    speed = 4 * s["lowest_frequency_Hz"] * s["shear_strain"] * s["sample_side_m"]
    yield row("v_dma_shear_speed_20_hz", speed, paper=s["shear_speed_m_s"])
    yield from _table3(table)
    yield from _refits(table)


def largest_deviation(table: DmaTable, rows: NDArray[np.bool_]) -> float:
    """Largest over smallest value of the samples less 1, the most of storage and loss modulus over the `rows`."""
    most = 0.0
    for f in np.unique(table.frequency[rows]):
        same = table.modulus[table.frequency == f]
        most = max(most, *(float(part.max() / part.min() - 1) for part in (same.real, same.imag)))
    return most


def residual_shares(table: DmaTable, fit: Complex) -> dict[tuple[float, str], tuple[float, float]]:
    """By (frequency in Hz, modulus): mean relative error of a fit, and its share of the squared residual."""
    error = table.modulus - fit
    total = float(np.sum(np.abs(error) ** 2))
    out = {}
    for f in np.unique(table.frequency):
        at = table.frequency == f
        for name, part in (("storage", np.real), ("loss", np.imag)):
            off = float(np.mean(part(table.modulus[at]) / part(fit[at]) - 1))
            out[float(f), name] = (off, float(np.sum(part(error[at]) ** 2)) / total)
    return out


def _table3(table: DmaTable) -> Iterator[Row]:
    first, target = table.sample == 1, table.modulus
    models = {reading: table.table3(reading) for reading in ("radians", "hertz")}
    for reading, model in models.items():
        for f in (20, 60):
            at = first & (table.frequency == f)
            tangent, seen = (float((y[at].imag / y[at].real)[0]) for y in (model, target))
            differs = ("1", "consistent", "sample_1") if abs(tangent / seen - 1) < 0.05 else None
            fill: dict[str, Any] = {"f": f, "reading": TEXT(f"reading.{reading}")}
            yield row("v_dma_tan_delta", tangent, f, reading, measured=seen, differs=differs, **fill)
    at = first & (table.frequency == 20)
    yield row("v_dma_modulus_scale", float((target[at].real / models["radians"][at].real)[0]))
    yield row("v_dma_error_table3", relative_error(models["hertz"], target))
    for reading in ("hertz", "radians"):
        error = relative_error(best_scale(models[reading], target) * models[reading], target)
        yield row("v_dma_error_table3_scaled", error, reading, reading=TEXT(f"reading.{reading}"))


def _refits(table: DmaTable) -> Iterator[Row]:
    target, omega = table.modulus, table.omega
    fits = {law.name: fit_spectrum(law, omega, target)(omega) for law in (FIVE_ELEMENTS, SPRINGPOT)}
    for key, law in (("five_element", FIVE_ELEMENTS), ("springpot", SPRINGPOT)):
        for out, error in (
            ("in_sample", relative_error(fits[law.name], target)),
            ("sample_out", left_out_error(law, omega, target, table.sample)),
            ("frequency_out", left_out_error(law, omega, target, table.frequency)),
        ):
            yield row(f"v_dma_{out}", error, own=f"v_dma_{key}_{out}", law=law.name)
    mean = np.array([target[table.frequency == f].mean() for f in table.frequency])
    yield row("v_dma_sample_spread", relative_error(mean, target))
    fit = fits[FIVE_ELEMENTS.name]
    dip = (target.real / fit.real - 1)[table.frequency == _DIP_HZ]
    shares = residual_shares(table, fit)
    least_most: dict[str, Any] = {"least": dip.max(), "most": dip.min(), "share": shares[_DIP_HZ, "storage"][1]}
    yield row("v_dma_storage_dip_40_hz", float(dip.mean()), **least_most)
    for f, name in ((50.0, "storage"), (50.0, "loss"), (60.0, "loss")):
        off, share = shares[f, name]
        yield row("v_dma_refitted", off, own=f"v_dma_{name}_{f:g}_hz", name=name, f=f, share=share)


def moduli_drawing() -> Drawing:
    table = DmaTable.load()
    plot = Plot("frequency, Hz", "modulus, kPa", 500)
    for name, symbol, part in (("storage", "circle", np.real), ("loss", "diamond-open", np.imag)):
        plot.points(table.frequency, part(table.modulus) / 1e3, f"measured {name} modulus, three samples", symbol)
    f = np.linspace(18, 62, 120)
    omega = np.asarray(angular_frequency(f))
    fits = {law.name: fit_spectrum(law, table.omega, table.modulus) for law in (FIVE_ELEMENTS, SPRINGPOT)}
    curves = {f"{name}, refitted": fit(omega) for name, fit in fits.items()}
    scale = best_scale(table.table3("hertz"), table.modulus)
    curves[f"Table 3 times {scale:.0f}"] = scale * _complex(five_element_modulus(omega, high_speed_moduli()))
    for (name, values), colour in zip(curves.items(), ("printed", "third", "derived"), strict=True):
        plot.line(f, values.real / 1e3, f"{name}: storage", colour)
        plot.line(f, values.imag / 1e3, f"{name}: loss", colour, "dash")
    shares = residual_shares(table, fits[FIVE_ELEMENTS.name](table.omega))
    dip = shares.pop((_DIP_HZ, "storage"))[1]
    rest = sorted(sorted(shares, key=lambda key: -shares[key][1])[:3])
    others = [TEXT("off", name=name, f=f, off=shares[f, name][0]) for f, name in rest]
    return plot.captioned("v_table_2", dip=dip, others=others, rest=sum(shares[key][1] for key in rest))
