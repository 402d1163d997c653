"""Paper C: the flat-car model's amplitude and period, which its own equations do not give, and its Fig. 8."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hil.app.papers.comparison import MN, Drawing, Plot, Row, row
from hil.report.theme import MUTED
from models.laws.flat_car import FlatCar
from models.parameter import load_set
from models.sets import load_measurement

_DASHES = ("dot", "dash", "dashdot")  # of the three samples


def measured_teeth(quantity: str) -> list[float]:
    """The three samples' `period` in s or `peak_to_peak_force` in N."""
    table = load_measurement("constant_velocity_summary").select(source="constant_velocity_section_2.3")
    return [float(v) for v in table.select(quantity=quantity)["value"]]


def flat_car_rows() -> Iterator[Row]:
    car, s = FlatCar.from_set(), load_set("zhang2014_constant_velocity")
    rise, limit, stated = car.time_to(s["amplitude_N"]), car.limiting_hoop_stress(), s["amplitude_N"]
    period, amplitude = (float(np.mean(measured_teeth(q))) for q in ("period", "peak_to_peak_force"))
    yield row("c_time_to_amplitude", rise)
    yield row("c_period", 2 * rise, paper=s["period_s"], measured=period)
    yield row("c_amplitude", float(car.spring_force(s["period_s"] / 2)), paper=stated, measured=amplitude)
    yield row("c_limiting_hoop_stress", limit)
    yield row("c_hoop_stress_at_amplitude", car.hoop_stress_for(stated))
    yield row("c_force_at_limit", limit * car.contact_area * math.tan(car.theta), paper=stated)
    speed = s["capsule_speed_m_s"]
    distance = float(np.median(measured_teeth("period"))) * speed
    yield row("c_spatial_period", distance, paper=s["period_s"] * speed, measured=period * speed)


def flat_car_drawing() -> Drawing:
    car, s = FlatCar.from_set(), load_set("zhang2014_constant_velocity")
    plot = Plot("time, s", "friction above its valley, mN", 460)
    end = 2 * max(measured_teeth("period"))
    t = np.linspace(0, end, 1500)
    rise = car.time_to(s["amplitude_N"])
    force = car.spring_force(rise - np.abs(t % (2 * rise) - rise))
    plot.line(t, force * MN, "Eq. 4-9 with Table 1, up to 56 mN", "derived")
    wave = _wave(t, s["period_s"], s["amplitude_N"])
    plot.line(t, wave * MN, "paper's simulation: stated amplitude and period", "printed")
    teeth = zip(measured_teeth("period"), measured_teeth("peak_to_peak_force"), _DASHES, strict=True)
    for i, (period, amplitude, dash) in enumerate(teeth, start=1):
        name = f"measured, sample {i}: mean amplitude and period"
        plot.line(t, _wave(t, period, amplitude) * MN, name, MUTED, dash)
        instants = period * np.arange(0.5, end / period)
        peaks = np.full(len(instants), amplitude * MN)
        plot.points(instants, peaks, "measured peak", colour=MUTED, showlegend=False)
    plot.points(measured_teeth("period"), [0.0] * len(_DASHES), "measured valleys", "diamond")
    return plot.captioned("c_fig_8", rise=rise, stress=car.limiting_hoop_stress())


def _wave(t: NDArray[np.float64], period: float, amplitude: float) -> NDArray[np.float64]:
    return np.asarray(amplitude * (1 - np.cos(2 * np.pi * t / period)) / 2)
