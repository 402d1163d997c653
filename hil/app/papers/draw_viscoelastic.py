"""Paper V's Fig. 5, 7 and 9, force against speed, and its dynamic moduli."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import plotly.graph_objects as go

from hil.app.papers.dma import DmaTable, best_scale, residual_shares
from hil.app.papers.drawing import DERIVED, FOURTH, MEASURED, PRINTED, THIRD, Drawing, axes, line, points
from hil.app.papers.refit import FIVE_ELEMENTS, SPRINGPOT, Complex, fit_spectrum
from hil.app.papers.viscoelastic import BAND_SPEED, HIGH_SPEEDS, measured_band, viscoelastic_rig
from models.laws.five_elements import angular_frequency, five_element_modulus, high_speed_moduli
from models.laws.geometry import Regime
from models.laws.resistance import Resistance, sliding_resistance
from models.parameter import load_set

_MN = 1e3  # in a newton
_TOP, _JUMP = HIGH_SPEEDS[-1], HIGH_SPEEDS[0]


def viscoelastic_drawings() -> Iterator[Drawing]:
    """Fig. 5, 7, 9 and Table 2."""
    yield _components()
    yield _updated()
    yield _validation()
    yield _moduli()


def _force(speed: Any, regime: Regime) -> Resistance:
    """Paper V's force at `speed` in m/s with one of its sets of moduli, or both."""
    capsule, tissue = viscoelastic_rig()
    return sliding_resistance(speed, capsule, replace(tissue, regime=regime))


def _band(figure: Any) -> None:
    valley, peak = (f * _MN for f in measured_band())
    half = (peak - valley) / 2
    name = f"measured at 10 mm/s with C's capsule of 3.9 g:<br>{valley:.0f} to {peak:.0f} mN (A Section 5.1)"
    marker = {"color": MEASURED, "size": 9}
    spread = {"type": "data", "array": [half], "thickness": 2, "width": 8, "color": MEASURED}
    place = {"x": [BAND_SPEED * 1e3], "y": [valley + half]}
    figure.add_trace(go.Scatter(**place, error_y=spread, mode="markers", marker=marker, name=name))


def _components() -> Drawing:
    v = np.linspace(0.2e-3, _TOP, 240)
    force = _force(v, "low")
    figure = axes("speed, mm/s", "force, mN", yaxis_rangemode="tozero")
    parts = [
        (force.total, "total F", PRINTED),
        (force.environmental, "environmental resistance F_e", DERIVED),
        (force.coulomb, "Coulomb friction F_c", THIRD),
        (force.viscous, "viscous resistance F_v", FOURTH),
    ]
    for values, name, colour in parts:
        line(figure, v * 1e3, values * _MN, name, colour)
    _band(figure)
    coulomb = load_set("zhang2014_viscoelastic_rig")["mean_coulomb_force_N"] * _MN
    points(figure, [0.5], [coulomb], "measured: weight alone, lumen held open (40.07 mN)", "diamond")
    caption = (
        "Low-speed moduli (stress relaxation, Eq. 13) at all speeds; capsule of 50.1 g. The paper's own measured curve"
        " is not printed as numbers; the points are those that the papers quote. The diamond is the weight's share of"
        " F_c only."
    )
    return Drawing("V, Fig. 5: force against speed and its components", caption, figure)


def _updated() -> Drawing:
    slow, fast, every = (np.linspace(*span) for span in ((0.2e-3, _JUMP, 100), (_JUMP, _TOP, 120), (0.2e-3, _TOP, 480)))
    figure = axes("speed, mm/s", "force, mN")
    line(figure, slow * 1e3, _force(slow, "low").total * _MN, "low-speed moduli (Eq. 13)", PRINTED)
    line(figure, fast * 1e3, _force(fast, "high").total * _MN, "high-speed moduli (Table 3)", DERIVED)
    line(figure, every * 1e3, _force(every, "blend").total * _MN, "blend over 2 mm/s", THIRD, "dot")
    _band(figure)
    low, high = float(_force(_JUMP, "low").total), float(_force(_JUMP, "high").total)
    caption = (
        "The paper changes moduli at 20 mm/s and calls what follows an inflection point; with its numbers the force"
        f" drops there by {(low - high) * _MN:.1f} mN."
    )
    return Drawing("V, Fig. 7: updated force against speed", caption, figure)


def _validation() -> Drawing:
    v = np.linspace(0.2e-3, _TOP, 480)
    force = _force(v, "blend")
    figure = axes("speed, mm/s", "force, mN", yaxis_rangemode="tozero")
    line(figure, v * 1e3, force.total * _MN, "theory (blend of both sets)", PRINTED)
    line(figure, v * 1e3, (force.environmental + force.viscous) * _MN, "without the Coulomb part", PRINTED, "dot")
    _band(figure)
    caption = (
        "The paper compares this curve with two samples of jejunum and states R^2 of 0.9928 and 0.9901 above 20 mm/s;"
        " the measured points are not printed, so that cannot be reproduced. The band at 10 mm/s is what paper A"
        " quotes of a capsule of 3.9 g, this curve is of 50.1 g."
    )
    return Drawing("V, Fig. 9: theory and experiment", caption, figure)


def _moduli() -> Drawing:
    table = DmaTable.load()
    figure = axes("frequency, Hz", "modulus, kPa", height=500)
    for name, symbol, part in (("storage", "circle", np.real), ("loss", "diamond-open", np.imag)):
        points(figure, table.frequency, part(table.modulus) / 1e3, f"measured {name} modulus, three samples", symbol)
    f = np.linspace(18, 62, 120)
    omega = np.asarray(angular_frequency(f))
    measured_omega = np.asarray(angular_frequency(table.frequency))
    curves: dict[str, tuple[Complex, str]] = {}
    for law, colour in ((FIVE_ELEMENTS, PRINTED), (SPRINGPOT, THIRD)):
        curves[f"{law.name}, refitted"] = (fit_spectrum(law, measured_omega, table.modulus)(omega), colour)
    y = five_element_modulus(omega, high_speed_moduli())
    scale = best_scale(table.table3("hertz"), table.modulus)
    curves[f"Table 3 times {scale:.0f}"] = (np.asarray(scale * (y.storage + 1j * y.loss), dtype=np.complex128), DERIVED)
    for name, (values, colour) in curves.items():
        line(figure, f, values.real / 1e3, f"{name}: storage", colour)
        line(figure, f, values.imag / 1e3, f"{name}: loss", colour, "dash")
    shares = residual_shares(table, fit_spectrum(FIVE_ELEMENTS, measured_omega, table.modulus)(measured_omega))
    dip = shares.pop((40.0, "storage"))[1]
    rest = sorted(shares, key=lambda key: -shares[key][1])[:3]
    others = ", ".join(f"{name} at {f:g} Hz {shares[f, name][0]:+.0%}" for f, name in sorted(rest))
    caption = (
        "Table 3 is said to be fitted to these data and misses them by two orders of magnitude. Of the squared residual"
        f" of the refit the dip of the storage modulus at 40 Hz is {dip:.0%}; {others} make"
        f" {sum(shares[key][1] for key in rest):.0%}. All of it is alike in the three samples. A relaxation law's"
        " storage modulus only grows with frequency, so none gives the dip."
    )
    return Drawing("V, Table 2: dynamic moduli, and what the relaxation laws make of them", caption, figure)
