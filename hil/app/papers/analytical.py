"""Paper A: the stick-slip curve as printed and as its own equations give it, and the forces it states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hil.app.papers.row import Row, Verdict, row
from models.laws.elastic_nose import elastic_coulomb_limit, initial_resistance
from models.laws.geometry import Capsule, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants
from models.laws.resistance import mucus_drag
from models.laws.stick_slip import (
    Tension,
    Tooth,
    printed_force,
    printed_tension,
    quasi_static_tension,
    stick_slip_tooth,
)
from models.parameter import ParameterSet, load_set
from models.sets import load_measurement

_COLUMNS = {"period": "period_s", "valley": "valley_N", "peak": "peak_N"}
_DIVISION = "Eq. 18-20 multiply by powers of the stretch where Eq. 1 and 3 divide, and print 12.01 for 12.1"


@dataclass(frozen=True)
class Setting:
    """Paper A's capsule, tissue, wall and stated results, and the stick-slip cycle that follows from them."""

    stated: ParameterSet
    capsule: Capsule
    tissue: Tissue
    wall: WallConstants

    @classmethod
    def load(cls) -> Setting:
        """Read the paper's parameter sets."""
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

    def printed(self) -> Tension:
        """Tension of Eq. 18."""
        return printed_tension(stretched_length(self.capsule))

    def derived(self, stretched_length_m: float) -> Tension:
        """Tension of Eq. 1, 3 and 12."""
        return quasi_static_tension(self.wall, wall_section(self.capsule, self.tissue), stretched_length_m)

    def tooth(self, tension: Tension) -> Tooth:
        """The tooth up to the stated amplitude at the paper's speeds."""
        return stick_slip_tooth(
            tension, self.amplitude, self.stated["capsule_speed_m_s"], self.stated["recoil_speed_m_s"]
        )


def mean_of(column: str) -> float:
    """Mean over the eight periods of paper A's Table 2."""
    return float(np.mean(load_measurement("analytical_table2_periods")[column]))


def analytical_rows() -> Iterator[Row]:
    """Every line about paper A."""
    setting = Setting.load()
    yield from _printed_curve(setting)
    yield from _derived_curve(setting)
    yield from _stated_forces(setting)
    yield from _friction_range(setting)
    yield from _deviations(setting)
    yield from _thirty_periods()


def _printed_curve(a: Setting) -> Iterator[Row]:
    tooth, s = a.tooth(a.printed()), a.stated
    note = "with L_s = L + R = 26.5 mm, rise to 39.79 - 23.23 mN, fall at v_c + v_i: to all printed digits"
    quantity = "A: rise, Eq. 18-20 as printed"
    yield row("a_rise_printed", quantity, "s", tooth.rise_s, "reproduced", note, paper=s["rise_s"])
    quantity = "A: fall, Eq. 18-20 as printed"
    yield row("a_fall_printed", quantity, "s", tooth.fall_s, "reproduced", note, paper=s["fall_s"])
    quantity, measured = "A: period, Eq. 18-20 as printed", mean_of("period_s")
    key = "a_period_printed"
    yield row(key, quantity, "s", tooth.period_s, "reproduced", note, paper=s["period_s"], measured=measured)
    small = 1e-9
    ratio = a.printed()(small) / a.derived(stretched_length(a.capsule))(small)
    note = f"{_DIVISION}: the printed curve's wall is this much stiffer than the paper's own law at rest"
    quantity = "A: stiffness of the printed wall over that of Eq. 1"
    yield row("a_printed_wall_stiffness", quantity, "1", ratio, "misprint", note)
    note = "Eq. 18 at t = 0; its constant 215.5 is rounded"
    quantity = "A: Eq. 18 at its start"
    yield row("a_eq18_start", quantity, "mN", printed_force(1.0), "consistent", note, paper=s["initial_force_N"])
    fall_start = load_set("zhang2016_printed_curve")["matrix_N"]
    note = (
        "Eq. 19 is printed without its constant: at t = 0 only the term 192.2/m^2 is left; the curve here starts at"
        " F_critical"
    )
    yield row("a_eq19_start", "A: Eq. 19 at its start", "mN", fall_start, "misprint", note, paper=s["critical_force_N"])
    note = "the wall's drag at the tip of a tooth, v_c times the rise"
    yield row("a_tip_drag", "A: drag of the wall at the tip u_c", "mm", tooth.drag_m, "check value", note)
    recovery = tooth.drag_m / s["recoil_speed_m_s"]
    note = (
        "u_c/v_i: the 0.05 s that the wall is said to need to recover, and the constant that makes A's 0.6 and C's 6"
        " mm/s one"
    )
    stated = s["recovery_time_s"]
    quantity = "A: recovery of the wall, Section 5.3"
    yield row("a_recovery_time", quantity, "s", recovery, "consistent", note, paper=stated)


def _derived_curve(a: Setting) -> Iterator[Row]:
    measured = mean_of("period_s")
    for length in (stretched_length(a.capsule), a.capsule.cylinder_length_m):
        tooth = a.tooth(a.derived(length))
        key = f"{length * 1e3:g}".replace(".", "_")
        label = f"Eq. 1, 3, 12, L_s {length * 1e3:g} mm"
        yield row(f"a_rise_law_{key}", f"A: rise, {label}", "s", tooth.rise_s, "misprint", _DIVISION)
        yield row(f"a_fall_law_{key}", f"A: fall, {label}", "s", tooth.fall_s, "misprint", _DIVISION)
        note = "the correct law misses the measured mean period: a real effect is missing at small, fast stretch"
        miss: Verdict = "misses the measurement"
        yield row(f"a_period_law_{key}", f"A: period, {label}", "s", tooth.period_s, miss, note, measured=measured)
        error = tooth.period_s / measured - 1
        yield row(f"a_period_error_law_{key}", f"A: period off the measured mean, {label}", "%", error, miss, note)


def _stated_forces(a: Setting) -> Iterator[Row]:
    s = a.stated
    note = (
        "Eq. 6-11 with Table 1 (alpha 30 deg, D0 = 2 R cos(alpha)) give many times what is stated: "
        "treat F_initial and f_c, or alpha and mu, as identified"
    )
    initial = initial_resistance(a.capsule, a.tissue, a.wall)
    limit = elastic_coulomb_limit(a.capsule, a.tissue, a.wall)
    none: Verdict = "not reproducible"
    valley, stated = mean_of("valley_N"), s["initial_force_N"]
    yield row("a_initial_force", "A: F_initial, Eq. 6, 10", "mN", initial, none, note, paper=stated, measured=valley)
    tooth = mean_of("peak_N") - valley
    yield row("a_coulomb_limit", "A: f_c, Eq. 8, 9", "mN", limit, none, note, paper=a.amplitude, measured=tooth)
    drag = mucus_drag(s["capsule_speed_m_s"], Tissue().mucus_thickness_m)
    note = "V Eq. 9, 10 with w in mm/s and h in mm; only this reading of the garbled equation comes near"
    quantity = "A: mucus drag at 0.5 mm/s"
    yield row("a_viscous_force", quantity, "mN", drag, "consistent", note, paper=s["viscous_force_N"])


def _friction_range(a: Setting) -> Iterator[Row]:
    s = a.stated
    for end in ("low", "high"):
        mu, stated = s[f"friction_coefficient_{end}"], s[f"critical_force_{end}_N"]
        force = s["initial_force_N"] + a.amplitude * mu / s["friction_coefficient"]
        note = "F_initial + f_c, f_c in proportion to the coefficient (Eq. 8, 11), from 23.23 and 16.56 mN"
        quantity = f"A: F_critical at a friction coefficient of {mu:g}, Section 5.2"
        key = f"a_critical_force_friction_{end}"
        yield row(key, quantity, "mN", force, "reproduced", note, paper=stated)


def _thirty_periods() -> Iterator[Row]:
    """How far the eight periods that a fit may use are from the thirty that the paper gives as one number each."""
    for name, means in thirty_periods().items():
        eight = mean_of(_COLUMNS[name])
        least, most = sorted(abs(eight / mean - 1) for mean in means)
        note = (
            "the paper prints the deviation from its curve without a sign: a model that meets the eight exactly is"
            f" {least:.1%} or {most:.1%} off the thirty (which may contain them); the smaller is shown"
        )
        quantity = f"A: {name} of eight periods against that of thirty"
        yield row(f"a_hold_out_{name}", quantity, "%", least, "finding", note)


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


def _deviations(a: Setting) -> Iterator[Row]:
    s, period = a.stated, a.tooth(a.printed()).period_s
    stated = {
        "period": (period, "period_s"),
        "valley": (s["initial_force_N"], "valley_N"),
        "peak": (s["critical_force_N"], "peak_N"),
    }
    for name, (model, column) in stated.items():
        deviation = abs(mean_of(column) / model - 1)
        note = (
            "Table 2's mean of eight against the printed curve; it agrees because the curve's wall is misprinted"
            " stiffer"
        )
        quantity = f"A: deviation of the {name}, Table 2"
        yield row(f"a_deviation_{name}", quantity, "%", deviation, "reproduced", note, paper=s[f"{name}_deviation"])
