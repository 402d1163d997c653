"""Paper V's Table 3 against the dynamic moduli of its Table 2, and what other relaxation laws make of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hil.app.papers.refit import FIVE_ELEMENTS, SPRINGPOT, Complex, Real, fit_spectrum, left_out_error, relative_error
from hil.app.papers.row import Row, Verdict, row
from models.laws.dynamic_modulus import Reading, angular_frequency, five_element_modulus
from models.laws.hoop import high_speed_moduli
from models.sets import load_measurement

_DIP_HZ = 40.0


@dataclass(frozen=True)
class DmaTable:
    """Table 2: frequency in Hz, sample number and complex modulus in Pa, each of shape (15,)."""

    frequency: Real
    sample: Real
    modulus: Complex

    @classmethod
    def load(cls) -> DmaTable:
        """Read the printed table."""
        t = load_measurement("viscoelastic_table2_dma")
        return cls(t["frequency_Hz"], t["sample"], t["storage_modulus_Pa"] + 1j * t["loss_modulus_Pa"])

    def table3(self, reading: Reading) -> Complex:
        """What Table 3's moduli give at the measured frequencies, in Pa."""
        y = five_element_modulus(angular_frequency(self.frequency, reading), high_speed_moduli())
        return np.asarray(y.storage + 1j * y.loss)


def best_scale(model: Complex, target: Complex) -> float:
    """The real factor on `model` that minimises `||scale model - target||`."""
    return float(np.real(np.vdot(model, target)) / np.real(np.vdot(model, model)))


def dma_rows() -> Iterator[Row]:
    """Every line about paper V's dynamic tests."""
    table = DmaTable.load()
    yield from _loss_tangents(table)
    yield from _table3_errors(table)
    yield from _refits(table)
    yield from _what_remains(table)


def _loss_tangents(table: DmaTable) -> Iterator[Row]:
    first = table.sample == 1
    notes = {"radians": '"Hz" read as rad/s', "hertz": "omega = 2 pi f"}
    readings: tuple[Reading, ...] = ("radians", "hertz")
    for reading in readings:
        model = table.table3(reading)
        for f in (20, 60):
            at = first & (table.frequency == f)
            tangent, measured = (float((y[at].imag / y[at].real)[0]) for y in (model, table.modulus))
            verdict: Verdict = "consistent" if abs(tangent / measured - 1) < 0.05 else "not reproducible"
            quantity = f"V: tan delta of Table 3 at {f} Hz ({notes[reading]})"
            yield row(
                f"v_dma_tan_delta_{f}_{reading}",
                quantity,
                "1",
                tangent,
                verdict,
                "measured: sample 1",
                measured=measured,
            )


def _table3_errors(table: DmaTable) -> Iterator[Row]:
    none: Verdict = "not reproducible"
    radians, hertz = table.table3("radians"), table.table3("hertz")
    at = (table.sample == 1) & (table.frequency == 20)
    scale = float((table.modulus[at].real / radians[at].real)[0])
    note = "storage modulus of sample 1 over Table 3's at 20 Hz read as rad/s, where tan delta agrees; about 128"
    yield row("v_dma_modulus_scale", "V: modulus of Table 2 over that of Table 3", "1", scale, none, note)
    note = "relative error of the complex modulus over all samples and frequencies: Table 3 does not reproduce Table 2"
    yield row("v_dma_error_table3", "V: error of Table 3", "%", relative_error(hertz, table.modulus), none, note)
    for key, name, model in (("hertz", "omega = 2 pi f", hertz), ("radians", '"Hz" read as rad/s', radians)):
        error = relative_error(best_scale(model, table.modulus) * model, table.modulus)
        quantity = f"V: error of Table 3 with a free scale ({name})"
        yield row(f"v_dma_error_table3_scaled_{key}", quantity, "%", error, none, note)


def _refits(table: DmaTable) -> Iterator[Row]:
    omega = np.asarray(angular_frequency(table.frequency))
    for key, law in (("five_element", FIVE_ELEMENTS), ("springpot", SPRINGPOT)):
        fit = fit_spectrum(law, omega, table.modulus)
        inside = relative_error(fit(omega), table.modulus)
        sample = left_out_error(law, omega, table.modulus, table.sample)
        frequency = left_out_error(law, omega, table.modulus, table.frequency)
        note = "least squares on the complex modulus, omega = 2 pi f; mean over what is left out in turn"
        yield row(f"v_dma_{key}_in_sample", f"V: {law.name} refitted, in sample", "%", inside, "finding", note)
        yield row(f"v_dma_{key}_sample_out", f"V: {law.name} refitted, a sample left out", "%", sample, "finding", note)
        yield row(
            f"v_dma_{key}_frequency_out",
            f"V: {law.name} refitted, a frequency left out",
            "%",
            frequency,
            "finding",
            note,
        )


def _what_remains(table: DmaTable) -> Iterator[Row]:
    mean = np.array([table.modulus[table.frequency == f].mean() for f in table.frequency])
    note = "error of the samples' own mean at each frequency: the least that any law of frequency could leave"
    yield row(
        "v_dma_sample_spread",
        "V: spread of the three samples",
        "%",
        relative_error(mean, table.modulus),
        "finding",
        note,
    )
    omega = np.asarray(angular_frequency(table.frequency))
    fit = fit_spectrum(FIVE_ELEMENTS, omega, table.modulus)(omega)
    dip = (table.modulus.real / fit.real - 1)[table.frequency == _DIP_HZ]
    note = (
        f"the dip is {dip.max():.0%} to {dip.min():.0%} in the three samples: what remains is common to all of them "
        "and no relaxation law explains it"
    )
    yield row(
        "v_dma_storage_dip_40_hz",
        "V: storage modulus at 40 Hz against the refit",
        "%",
        float(dip.mean()),
        "finding",
        note,
    )
