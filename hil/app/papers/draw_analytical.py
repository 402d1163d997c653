"""Paper A's Fig. 5 to 7: the rise, the fall and three periods of the saw, with the eight measured periods."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil.app.papers.analytical import Setting, mean_of
from hil.app.papers.drawing import DERIVED, MEASURED, PRINTED, THIRD, Drawing, axes, line, points
from models.laws.geometry import stretched_length
from models.laws.stick_slip import Tension, Tooth, friction_curve
from models.sets import load_measurement

_MN = 1e3  # in a newton
_PERIODS = 3  # of the saw that are drawn


@dataclass(frozen=True)
class Curve:
    """One reading of the paper's wall: its name, colour, tension and tooth."""

    name: str
    colour: str
    tension: Tension
    tooth: Tooth


def _curves(a: Setting) -> list[Curve]:
    long, short = stretched_length(a.capsule), a.capsule.cylinder_length_m
    readings = [
        ("as printed (Eq. 18-20)", PRINTED, a.printed()),
        (f"Eq. 1, 3, 12, L_s {long * 1e3:g} mm", DERIVED, a.derived(long)),
        (f"Eq. 1, 3, 12, L_s {short * 1e3:g} mm", THIRD, a.derived(short)),
    ]
    return [Curve(name, colour, tension, a.tooth(tension)) for name, colour, tension in readings]


def analytical_drawings() -> Iterator[Drawing]:
    """Fig. 5, 6 and 7."""
    a = Setting.load()
    curves = _curves(a)
    table = load_measurement("analytical_table2_periods")
    share = curves[0].tooth.rise_s / curves[0].tooth.period_s
    yield _rise(a, curves, share * table["period_s"], table["peak_N"])
    yield _fall(a, curves, (1 - share) * table["period_s"], table["valley_N"])
    yield _saw(a, curves, share)


def _rise(a: Setting, curves: list[Curve], instants: NDArray[np.float64], peaks: NDArray[np.float64]) -> Drawing:
    figure = axes("time since sticking, s", "friction, mN")
    for c in curves:
        t = np.linspace(0, c.tooth.rise_s, 200)
        force = a.stated["initial_force_N"] + c.tension(c.tooth.drag_m * t / c.tooth.rise_s)
        line(figure, t, force * _MN, c.name, c.colour)
    points(figure, instants, peaks * _MN, "measured peaks (Table 2)", "circle")
    points(figure, [0.0], [mean_of("valley_N") * _MN], "measured mean valley", "diamond")
    derived = " to ".join(f"{c.tooth.rise_s:.3f}" for c in reversed(curves[1:]))
    caption = (
        "Friction while the wall sticks and is stretched. Eq. 18 multiplies by powers of the stretch where Eq. 1 and 3"
        f" divide; the wall of Eq. 1 needs {derived} s for the same rise. The instants of the measured peaks are not"
        " printed; they are drawn at the printed curve's share of each measured period."
    )
    return Drawing("A, Fig. 5: friction increasing", caption, figure)


def _fall(a: Setting, curves: list[Curve], instants: NDArray[np.float64], valleys: NDArray[np.float64]) -> Drawing:
    figure = axes("time since slipping, s", "friction, mN")
    for c in curves:
        t = np.linspace(0, c.tooth.fall_s, 200)
        force = a.stated["critical_force_N"] - c.tension(c.tooth.drag_m * t / c.tooth.fall_s)
        line(figure, t, force * _MN, c.name, c.colour)
    points(figure, instants, valleys * _MN, "measured valleys (Table 2)", "diamond")
    points(figure, [0.0], [mean_of("peak_N") * _MN], "measured mean peak", "circle")
    caption = (
        "Friction while the wall draws back at v_c + v_i = 1.1 mm/s. Eq. 19 is printed without its constant and would"
        " start at 192 mN; here it starts at F_critical. Valleys are drawn at the printed curve's share of each"
        " measured period."
    )
    return Drawing("A, Fig. 6: friction decreasing", caption, figure)


def _saw(a: Setting, curves: list[Curve], share: float) -> Drawing:
    figure = axes("time, s", "friction, mN")
    end = _PERIODS * curves[0].tooth.period_s
    for c in curves:
        corners = [k * c.tooth.period_s + x for k in range(_PERIODS) for x in (0.0, c.tooth.rise_s)]
        t = np.unique(np.concatenate([np.linspace(0, end, 600), [x for x in corners if x < end]]))
        line(figure, t, friction_curve(t, c.tension, c.tooth, a.stated["initial_force_N"]) * _MN, c.name, c.colour)
    _measured_teeth(figure, share)
    caption = (
        f"Three periods of the printed curve ({curves[0].tooth.period_s:.4f} s each), and the first three of the eight"
        f" measured periods (mean of all eight {mean_of('period_s'):.4f} s) end to end, their peaks at the printed"
        " curve's share of the period. In the same time the wall of Eq. 1 finishes at most one."
    )
    return Drawing("A, Fig. 7: three periods of the fluctuation", caption, figure)


def _measured_teeth(figure: Any, share: float) -> None:
    table = load_measurement("analytical_table2_periods")
    periods, valleys, peaks = (table[name][:_PERIODS] for name in ("period_s", "valley_N", "peak_N"))
    starts = np.concatenate([[0.0], np.cumsum(periods)[:-1]])
    tips = starts + share * periods
    order = np.argsort(np.concatenate([starts, tips]))
    t, force = np.concatenate([starts, tips])[order], np.concatenate([valleys, peaks])[order]
    line(figure, t, force * _MN, "measured, joined", MEASURED, "dot")
    points(figure, starts, valleys * _MN, "measured valleys", "diamond")
    points(figure, tips, peaks * _MN, "measured peaks", "circle")
