"""Paper A: the stick-slip curve as printed and as its own equations give it, the forces it states, its Fig. 5 to 7."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from hil.app.papers.comparison import MN, Drawing, Plot, Row, row
from models.laws.geometry import Capsule, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants
from models.laws.resistance import mucus_drag
from models.laws.stick_slip import (
    Tension,
    Tooth,
    elastic_coulomb_limit,
    friction_curve,
    initial_resistance,
    printed_force,
    printed_tension,
    quasi_static_tension,
    stick_slip_tooth,
)
from models.parameter import ParameterSet, load_set
from models.sets import load_measurement

_COLUMNS: Final = {"period": "period_s", "valley": "valley_N", "peak": "peak_N"}
_PERIODS: Final = 3  # of the saw that are drawn


@dataclass(frozen=True)
class Setting:
    """Paper A's capsule, tissue, wall and stated results, and the stick-slip cycle that follows from them."""

    stated: ParameterSet
    capsule: Capsule
    tissue: Tissue
    wall: WallConstants

    @classmethod
    def load(cls) -> Setting:
        s = load_set("zhang2016_rig")
        capsule = Capsule(s["radius_m"], s["cylinder_length_m"])
        tissue = Tissue(
            wall_thickness_m=s["wall_thickness_m"],
            contact_angle_deg=s["contact_angle_deg"],
            friction_coefficient=s["friction_coefficient"],
        )
        return cls(s, capsule, tissue, WallConstants.from_set())

    @property
    def amplitude(self) -> float:
        """`F_critical - F_initial` as stated, in N."""
        return self.stated["critical_force_N"] - self.stated["initial_force_N"]

    @property
    def lengths(self) -> tuple[float, float]:
        """The two readings of L_s in m: with the nose stretched too, and the cylinder alone."""
        return stretched_length(self.capsule), self.capsule.cylinder_length_m

    def printed(self) -> Tension:
        """Tension of Eq. 18."""
        return printed_tension(stretched_length(self.capsule))

    def derived(self, stretched_length_m: float) -> Tension:
        """Tension of Eq. 1, 3 and 12."""
        return quasi_static_tension(self.wall, wall_section(self.capsule, self.tissue), stretched_length_m)

    def tooth(self, tension: Tension) -> Tooth:
        return stick_slip_tooth(
            tension, self.amplitude, self.stated["capsule_speed_m_s"], self.stated["recoil_speed_m_s"]
        )


def mean_of(column: str) -> float:
    return float(np.mean(load_measurement("analytical_table2_periods")[column]))


def analytical_rows() -> Iterator[Row]:
    """The curve as printed, as the equations give it, the forces that are stated, and the deviations of Table 2: how
    far the eight periods are from the thirty that the paper gives as one number each.
    """
    a, small = Setting.load(), 1e-9
    tooth, s, seen, valley = a.tooth(a.printed()), a.stated, mean_of("period_s"), mean_of("valley_N")
    yield row("a_rise_printed", tooth.rise_s, paper=s["rise_s"])
    yield row("a_fall_printed", tooth.fall_s, paper=s["fall_s"])
    yield row("a_period_printed", tooth.period_s, paper=s["period_s"], measured=seen)
    yield row("a_printed_wall_stiffness", a.printed()(small) / a.derived(stretched_length(a.capsule))(small))
    yield row("a_eq18_start", printed_force(1.0), paper=s["initial_force_N"])
    yield row("a_eq19_start", load_set("zhang2016_printed_curve")["matrix_N"], paper=s["critical_force_N"])
    yield row("a_tip_drag", tooth.drag_m)
    yield row("a_recovery_time", tooth.drag_m / s["recoil_speed_m_s"], paper=s["recovery_time_s"])
    for length in a.lengths:
        derived, at = a.tooth(a.derived(length)), f"{1e3 * length:g}"
        yield row("a_rise_law", derived.rise_s, at, L_s=length)
        yield row("a_fall_law", derived.fall_s, at, L_s=length)
        yield row("a_period_law", derived.period_s, at, measured=seen, L_s=length)
        yield row("a_period_error_law", derived.period_s / seen - 1, at, L_s=length)
    rig, first = (a.capsule, a.tissue, a.wall), s["initial_force_N"]
    yield row("a_initial_force", initial_resistance(*rig), paper=first, measured=valley)
    rise = mean_of("peak_N") - valley
    yield row("a_coulomb_limit", elastic_coulomb_limit(*rig), paper=a.amplitude, measured=rise)
    drag = mucus_drag(s["capsule_speed_m_s"], Tissue().mucus_thickness_m)
    yield row("a_viscous_force", drag, paper=s["viscous_force_N"])
    for end in ("low", "high"):
        mu = s[f"friction_coefficient_{end}"]
        force, stated = first + a.amplitude * mu / s["friction_coefficient"], s[f"critical_force_{end}_N"]
        yield row("a_critical_force_friction", force, end, paper=stated, mu=mu)
    for name, model in (("period", tooth.period_s), ("valley", first), ("peak", s["critical_force_N"])):
        off = abs(mean_of(_COLUMNS[name]) / model - 1)
        yield row("a_deviation", off, name, paper=s[f"{name}_deviation"], name=name)
    for name, means in thirty_periods().items():
        least, most = sorted(abs(mean_of(_COLUMNS[name]) / mean - 1) for mean in means)
        yield row("a_hold_out", least, name, name=name, least=least, most=most)


def thirty_periods() -> dict[str, tuple[float, float]]:
    """The two means (SI) of period, valley and peak over A's thirty periods that its unsigned deviations allow."""
    s = load_set("zhang2016_rig")
    printed = {"period": s["period_s"], "valley": s["initial_force_N"], "peak": s["critical_force_N"]}
    return {
        name: (value * (1 - s[f"{name}_deviation_30"]), value * (1 + s[f"{name}_deviation_30"]))
        for name, value in printed.items()
    }


def best_miss(value: float, means: tuple[float, float]) -> float:
    """The relative error of `value` against the nearer of two means."""
    return min((value / mean - 1 for mean in means), key=abs)


def analytical_drawings() -> Iterator[Drawing]:
    """Fig. 5 to 7: the rise, the fall and three periods of the saw, with the measured periods."""
    a = Setting.load()
    tensions = [a.printed(), *map(a.derived, a.lengths)]
    names = ["as printed (Eq. 18-20)", *(f"Eq. 1, 3, 12, L_s {length * 1e3:g} mm" for length in a.lengths)]
    teeth = [a.tooth(tension) for tension in tensions]
    curves = list(zip(names, ("printed", "derived", "third"), tensions, teeth, strict=True))
    share = teeth[0].rise_s / teeth[0].period_s
    table = load_measurement("analytical_table2_periods")
    first, critical = a.stated["initial_force_N"], a.stated["critical_force_N"]

    rise, fall = Plot("time since sticking, s", "friction, mN"), Plot("time since slipping, s", "friction, mN")
    for name, colour, tension, tooth in curves:
        drag = np.linspace(0, 1, 200)
        rise.line(tooth.rise_s * drag, (first + tension(tooth.drag_m * drag)) * MN, name, colour)
        fall.line(tooth.fall_s * drag, (critical - tension(tooth.drag_m * drag)) * MN, name, colour)
    rise.points(share * table["period_s"], table["peak_N"] * MN, "measured peaks (Table 2)", "circle")
    rise.points([0.0], [mean_of("valley_N") * MN], "measured mean valley", "diamond")
    fall.points((1 - share) * table["period_s"], table["valley_N"] * MN, "measured valleys (Table 2)", "diamond")
    fall.points([0.0], [mean_of("peak_N") * MN], "measured mean peak", "circle")
    yield rise.captioned("a_rise", shortest=teeth[2].rise_s, longest=teeth[1].rise_s)
    yield fall.captioned("a_fall")

    saw, end = Plot("time, s", "friction, mN"), _PERIODS * teeth[0].period_s
    for name, colour, tension, tooth in curves:
        corners = [k * tooth.period_s + x for k in range(_PERIODS) for x in (0.0, tooth.rise_s)]
        t = np.unique(np.concatenate([np.linspace(0, end, 600), [x for x in corners if x < end]]))
        saw.line(t, friction_curve(t, tension, tooth, first) * MN, name, colour)
    periods, valleys, peaks = (table[name][:_PERIODS] for name in ("period_s", "valley_N", "peak_N"))
    starts = np.concatenate([[0.0], np.cumsum(periods)[:-1]])
    tips = starts + share * periods
    joined = np.ravel([starts, tips], "F"), np.ravel([valleys, peaks], "F") * MN
    saw.line(*joined, "measured, joined", "measured", "dot")
    saw.points(starts, valleys * MN, "measured valleys", "diamond")
    saw.points(tips, peaks * MN, "measured peaks", "circle")
    yield saw.captioned("a_saw", period=teeth[0].period_s, measured=mean_of("period_s"))
