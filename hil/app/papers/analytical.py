"""Paper A: the stick-slip curve as printed and as its own equations give it, and the forces it states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hil.app.papers.row import Row, rows
from models.laws.geometry import Capsule, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants
from models.laws.resistance import mucus_drag
from models.laws.stick_slip import (
    Tension,
    Tooth,
    elastic_coulomb_limit,
    initial_resistance,
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


def analytical_rows() -> list[Row]:
    """Every line about paper A."""
    a = Setting.load()
    parts = (_printed_curve, _derived_curve, _stated_forces, _friction_range, _deviations)
    return [line for part in parts for line in part(a)] + _thirty_periods()


def _printed_curve(a: Setting) -> list[Row]:
    tooth, s, small = a.tooth(a.printed()), a.stated, 1e-9
    ratio = a.printed()(small) / a.derived(stretched_length(a.capsule))(small)
    same = "with L_s = L + R = 26.5 mm, rise to 39.79 - 23.23 mN, fall at v_c + v_i: to all printed digits"
    stiffer = f"{_DIVISION}: the printed curve's wall is this much stiffer than the paper's own law at rest"
    eq19 = (
        "Eq. 19 is printed without its constant: at t = 0 only the term 192.2/m^2 is left; the curve here starts at"
        " F_critical"
    )
    start = load_set("zhang2016_printed_curve")["matrix_N"]
    drag = "the wall's drag at the tip of a tooth, v_c times the rise"
    recovery, time = tooth.drag_m / s["recoil_speed_m_s"], s["recovery_time_s"]
    recovers = (
        "u_c/v_i: the 0.05 s that the wall is said to need to recover, and the constant that makes A's 0.6 and C's 6"
        " mm/s one"
    )
    eq18 = "Eq. 18 at t = 0; its constant 215.5 is rounded"
    first, critical = s["initial_force_N"], s["critical_force_N"]
    period = tooth.period_s, "reproduced", same, s["period_s"], mean_of("period_s")
    return rows(
        "A",
        ("rise_printed", "rise, Eq. 18-20 as printed", "s", tooth.rise_s, "reproduced", same, s["rise_s"]),
        ("fall_printed", "fall, Eq. 18-20 as printed", "s", tooth.fall_s, "reproduced", same, s["fall_s"]),
        ("period_printed", "period, Eq. 18-20 as printed", "s", *period),
        ("printed_wall_stiffness", "stiffness of the printed wall over that of Eq. 1", "1", ratio, "misprint", stiffer),
        ("eq18_start", "Eq. 18 at its start", "mN", printed_force(1.0), "consistent", eq18, first),
        ("eq19_start", "Eq. 19 at its start", "mN", start, "misprint", eq19, critical),
        ("tip_drag", "drag of the wall at the tip u_c", "mm", tooth.drag_m, "check value", drag),
        ("recovery_time", "recovery of the wall, Section 5.3", "s", recovery, "consistent", recovers, time),
    )


def _derived_curve(a: Setting) -> Iterator[Row]:
    measured = mean_of("period_s")
    miss = (
        "misses the measurement",
        "the correct law misses the measured mean period: a real effect is missing at small, fast stretch",
    )
    for length in (stretched_length(a.capsule), a.capsule.cylinder_length_m):
        tooth = a.tooth(a.derived(length))
        key = f"{length * 1e3:g}".replace(".", "_")
        label = f"Eq. 1, 3, 12, L_s {length * 1e3:g} mm"
        off = tooth.period_s / measured - 1
        yield from rows(
            "A",
            (f"rise_law_{key}", f"rise, {label}", "s", tooth.rise_s, "misprint", _DIVISION),
            (f"fall_law_{key}", f"fall, {label}", "s", tooth.fall_s, "misprint", _DIVISION),
            (f"period_law_{key}", f"period, {label}", "s", tooth.period_s, *miss, None, measured),
            (f"period_error_law_{key}", f"period off the measured mean, {label}", "%", off, *miss),
        )


def _stated_forces(a: Setting) -> list[Row]:
    s, valley = a.stated, mean_of("valley_N")
    none = (
        "not reproducible",
        "Eq. 6-11 with Table 1 (alpha 30 deg, D0 = 2 R cos(alpha)) give many times what is stated: "
        "treat F_initial and f_c, or alpha and mu, as identified",
    )
    initial = initial_resistance(a.capsule, a.tissue, a.wall)
    limit = elastic_coulomb_limit(a.capsule, a.tissue, a.wall)
    drag, stated = mucus_drag(s["capsule_speed_m_s"], Tissue().mucus_thickness_m), s["viscous_force_N"]
    near = "V Eq. 9, 10 with w in mm/s and h in mm; only this reading of the garbled equation comes near"
    return rows(
        "A",
        ("initial_force", "F_initial, Eq. 6, 10", "mN", initial, *none, s["initial_force_N"], valley),
        ("coulomb_limit", "f_c, Eq. 8, 9", "mN", limit, *none, a.amplitude, mean_of("peak_N") - valley),
        ("viscous_force", "mucus drag at 0.5 mm/s", "mN", drag, "consistent", near, stated),
    )


def _friction_range(a: Setting) -> Iterator[Row]:
    s, note = a.stated, "F_initial + f_c, f_c in proportion to the coefficient (Eq. 8, 11), from 23.23 and 16.56 mN"
    for end in ("low", "high"):
        mu, stated = s[f"friction_coefficient_{end}"], s[f"critical_force_{end}_N"]
        force = s["initial_force_N"] + a.amplitude * mu / s["friction_coefficient"]
        quantity = f"F_critical at a friction coefficient of {mu:g}, Section 5.2"
        yield from rows("A", (f"critical_force_friction_{end}", quantity, "mN", force, "reproduced", note, stated))


def _deviations(a: Setting) -> Iterator[Row]:
    s = a.stated
    note = "Table 2's mean of eight against the printed curve; it agrees because the curve's wall is misprinted stiffer"
    period = a.tooth(a.printed()).period_s
    for name, model in (("period", period), ("valley", s["initial_force_N"]), ("peak", s["critical_force_N"])):
        off, stated = abs(mean_of(_COLUMNS[name]) / model - 1), s[f"{name}_deviation"]
        quantity = f"deviation of the {name}, Table 2"
        yield from rows("A", (f"deviation_{name}", quantity, "%", off, "reproduced", note, stated))


def _thirty_periods() -> list[Row]:
    """How far the eight periods that a fit may use are from the thirty that the paper gives as one number each."""
    lines = []
    for name, means in thirty_periods().items():
        least, most = sorted(abs(mean_of(_COLUMNS[name]) / mean - 1) for mean in means)
        note = (
            "the paper prints the deviation from its curve without a sign: a model that meets the eight exactly is"
            f" {least:.1%} or {most:.1%} off the thirty (which may contain them); the smaller is shown"
        )
        lines.append(
            (f"hold_out_{name}", f"{name} of eight periods against that of thirty", "%", least, "finding", note)
        )
    return rows("A", *lines)


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
