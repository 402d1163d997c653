"""Paper C's Fig. 8: stick-slip at 10 mm/s, computed, stated and measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.app.papers.drawing import DERIVED, MEASURED, PRINTED, Drawing, axes, line, points
from hil.app.papers.flat_car import measured_teeth
from models.laws.flat_car import FlatCar
from models.parameter import load_set

_MN = 1e3
_SHADES = ("#9ca3af", "#6b7280", "#374151")


def flat_car_drawing() -> Drawing:
    """Fig. 8: force above its valley over two measured periods."""
    car, s = FlatCar.from_set(), load_set("zhang2014_constant_velocity")
    figure = axes("time, s", "friction above its valley, mN")
    end = 2 * max(measured_teeth("period"))
    t = np.linspace(0, end, 1500)
    rise = car.time_to(s["amplitude_N"])
    line(
        figure,
        t,
        car.spring_force(rise - np.abs(t % (2 * rise) - rise)) * _MN,
        "Eq. 4-9 with Table 1, up to 56 mN",
        DERIVED,
    )
    line(
        figure,
        t,
        _wave(t, s["period_s"], s["amplitude_N"]) * _MN,
        "paper's simulation: stated amplitude and period",
        PRINTED,
    )
    teeth = zip(measured_teeth("period"), measured_teeth("peak_to_peak_force"), _SHADES, strict=True)
    for i, (period, amplitude, shade) in enumerate(teeth, start=1):
        line(
            figure,
            t,
            _wave(t, period, amplitude) * _MN,
            f"measured, sample {i}: mean amplitude and period",
            shade,
            "dot",
        )
        instants = period * np.arange(0.5, end / period)
        points(
            figure, instants, np.full(len(instants), amplitude * _MN), "measured peak", colour=shade, showlegend=False
        )
    points(figure, measured_teeth("period"), [0.0] * len(_SHADES), "measured valleys", "diamond", MEASURED)
    figure.update_layout(height=460)
    caption = (
        "The paper prints mean amplitude and period, not the curves: the measured samples and the paper's simulation"
        " are drawn as sine waves of those (the paper says its data look like one). Its equations reach 56 mN after"
        f" {rise:.3f} s, and the stated peak condition needs a hoop stress of {car.limiting_hoop_stress() / 1e6:.0f}"
        " MPa. The valley f_0 is not given."
    )
    return Drawing("C, Fig. 8: simulated and measured friction at 10 mm/s", caption, figure)


def _wave(t: NDArray[np.float64], period: float, amplitude: float) -> NDArray[np.float64]:
    return np.asarray(amplitude * (1 - np.cos(2 * np.pi * t / period)) / 2)
