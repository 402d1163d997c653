"""Paper C: the flat-car model's amplitude and period, which its own equations do not give, and its Fig. 8."""

import math

import numpy as np
from numpy.typing import NDArray

from hil.app.papers.drawing import DERIVED, MEASURED, PRINTED, Drawing, axes, line, points
from hil.app.papers.row import Row, rows
from models.laws.flat_car import FlatCar
from models.parameter import load_set
from models.sets import load_measurement

SOURCE = "constant_velocity_section_2.3"


_MN = 1e3  # in a newton
_SHADES = ("#9ca3af", "#6b7280", "#374151")


def measured_teeth(quantity: str) -> list[float]:
    """The three samples' `period` in s or `peak_to_peak_force` in N."""
    return [
        float(v)
        for v in load_measurement("constant_velocity_summary").select(source=SOURCE, quantity=quantity)["value"]
    ]


def flat_car_rows() -> list[Row]:
    """Every line about paper C."""
    car, s = FlatCar.from_set(), load_set("zhang2014_constant_velocity")
    none, speed, stated = "not reproducible", s["capsule_speed_m_s"], s["amplitude_N"]
    rise, limit, low = car.time_to(stated), car.limiting_hoop_stress(), car.hoop_stress_for(stated)
    period, amplitude = (float(np.mean(measured_teeth(q))) for q in ("period", "peak_to_peak_force"))
    reached = "Eq. 4-9 with Table 1: the stated amplitude is reached in a fraction of the stated period"
    twice = "stated 0.986 s; by Eq. 4-9 the car goes out to 56 mN and back at v_c in twice the time above"
    half = "Eq. 4-7: what the spring carries after half the stated period"
    never = "hoop stress at the stated peak condition, stretch 1/cos(60 deg) = 2: never met"
    less = (
        "Eq. 8, 9: the hoop stress that goes with 56 mN, tens of thousands of times less than the peak condition"
        " asks for"
    )
    in_space = (
        "speed times the median measured period, about 11 mm: if the period is one in space (folds, say), it has this"
        " length; a period in time looks the same at one speed"
    )
    force, needed = float(car.spring_force(s["period_s"] / 2)), limit * car.contact_area * math.tan(car.theta)
    way, *known = (t * speed for t in (float(np.median(measured_teeth("period"))), s["period_s"], period))
    return rows(
        "C",
        ("time_to_amplitude", "time to the stated 56 mN", "s", rise, none, reached),
        ("period", "period at 10 mm/s", "s", 2 * rise, none, twice, s["period_s"], period),
        ("amplitude", "amplitude at 10 mm/s", "mN", force, none, half, stated, amplitude),
        ("limiting_hoop_stress", "sigma_c at stretch 2", "MPa", limit, none, never),
        ("hoop_stress_at_amplitude", "sigma_c at 56 mN", "Pa", low, none, less),
        ("force_at_limit", "spring force at the peak condition", "N", needed, none, "Eq. 8, 9", stated),
        ("spatial_period", "way per period at 10 mm/s", "mm", way, "finding", in_space, *known),
    )


def flat_car_drawing() -> Drawing:
    """Fig. 8: force above its valley over two measured periods."""
    car, s = FlatCar.from_set(), load_set("zhang2014_constant_velocity")
    figure = axes("time, s", "friction above its valley, mN")
    end = 2 * max(measured_teeth("period"))
    t = np.linspace(0, end, 1500)
    rise = car.time_to(s["amplitude_N"])
    force = car.spring_force(rise - np.abs(t % (2 * rise) - rise))
    line(figure, t, force * _MN, "Eq. 4-9 with Table 1, up to 56 mN", DERIVED)
    wave = _wave(t, s["period_s"], s["amplitude_N"])
    line(figure, t, wave * _MN, "paper's simulation: stated amplitude and period", PRINTED)
    teeth = zip(measured_teeth("period"), measured_teeth("peak_to_peak_force"), _SHADES, strict=True)
    for i, (period, amplitude, shade) in enumerate(teeth, start=1):
        name = f"measured, sample {i}: mean amplitude and period"
        line(figure, t, _wave(t, period, amplitude) * _MN, name, shade, "dot")
        instants = period * np.arange(0.5, end / period)
        peaks = np.full(len(instants), amplitude * _MN)
        points(figure, instants, peaks, "measured peak", colour=shade, showlegend=False)
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
