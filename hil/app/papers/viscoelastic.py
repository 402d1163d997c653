"""Paper V: force over speed, friction coefficient, moduli over strain, Fig. 5, 7, 9; the base model's check values."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from hil.app.papers.comparison import COLOURS, MN, TEXT, Drawing, Plot, Row, at_speed, row, slug
from models.laws.five_elements import low_speed_moduli
from models.laws.geometry import GRAVITY, Capsule, Regime, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants, wall_tension
from models.laws.resistance import Resistance, mucus_drag, sliding_resistance
from models.parameter import load_set
from models.sets import load_measurement

LOW_SPEEDS = (0.5e-3, 1e-3, 5e-3, 10e-3, 20e-3)  # m/s, of the paper's slow pulls
HIGH_SPEEDS = (20e-3, 40e-3, 60e-3)  # m/s, of its fast ones
BAND_SPEED = 10e-3  # m/s, at which it measured a band


def viscoelastic_rig() -> tuple[Capsule, Tissue]:
    """Paper V's capsule (50.1 g) and tissue."""
    s = load_set("zhang2014_viscoelastic_rig")
    tissue = Tissue(**{key: s[key] for key in tuple(Tissue.__dataclass_fields__)[:5]})  # type: ignore[arg-type]
    return Capsule(s["radius_m"], s["cylinder_length_m"], s["mass_kg"]), tissue


def measured_band() -> tuple[float, float]:
    """Valley and peak at 10 mm/s in N (paper A Section 5.1)."""
    table = load_measurement("constant_velocity_summary").select(source="analytical_section_5.1")
    valley, peak = (float(table.select(quantity=q)["value"][0]) for q in ("valley_force", "peak_force"))
    return valley, peak


def viscoelastic_rows() -> Iterator[Row]:
    capsule, tissue = viscoelastic_rig()
    s = load_set("zhang2014_viscoelastic_rig")
    mu = s["mean_coulomb_force_N"] / (capsule.mass_kg * GRAVITY)
    yield row("v_friction_coefficient", mu, paper=s["friction_coefficient"])
    yield from _band(capsule, tissue)
    for v in LOW_SPEEDS:
        force, at = sliding_resistance(v, capsule, tissue), at_speed(v)
        major = bool(force.environmental > max(force.coulomb, force.viscous))
        differs = ("%", "consistent", "major") if major else None
        yield row("v_share_environmental", float(force.environmental / force.total), at, differs=differs, at=at)
    yield from _components("v_low", capsule, tissue, "low", LOW_SPEEDS)
    yield from _components("v_high", capsule, tissue, "high", HIGH_SPEEDS)
    table = load_measurement("viscoelastic_table1_relaxation")
    strain, fitted = table["shear_strain"], low_speed_moduli(table["shear_strain"])
    columns = {f"{name}_Pa": getattr(fitted, name) for name in ("E1", "E2", "E3")}
    columns |= {f"{name}_Pa_s": getattr(fitted, name) for name in ("eta1", "eta2")}
    best = [np.polyval(np.polyfit(strain, table[name], 2), strain) / table[name] - 1 for name in columns]
    errors = [value / table[name] - 1 for name, value in columns.items()]
    rms, least = (float(np.sqrt(np.mean(np.square(e)))) for e in (errors, best))
    yield row("v_eq13_against_table1", rms, least=least)


def _band(capsule: Capsule, tissue: Tissue) -> Iterator[Row]:
    valley, peak = measured_band()
    force = sliding_resistance(BAND_SPEED, capsule, tissue)
    band: dict[str, Any] = {"valley": MN * valley, "peak": peak}
    yield row("v_viscous_10_mm_s", force.viscous)
    yield row("v_total_10_mm_s", force.total, **band)
    c = load_set("zhang2014_constant_velocity")
    rig = replace(capsule, cylinder_length_m=c["cylinder_length_m"], mass_kg=c["mass_kg"])
    total, middle = sliding_resistance(BAND_SPEED, rig, tissue).total, (valley + peak) / 2
    differs = ("mN", "consistent", "capsule_c") if valley <= total <= peak else None
    yield row("v_total_10_mm_s_capsule_c", total, measured=middle, differs=differs, **band)


def _components(key: str, capsule: Capsule, tissue: Tissue, regime: Regime, speeds: tuple[float, ...]) -> Iterator[Row]:
    force = sliding_resistance(np.array(speeds), capsule, replace(tissue, regime=regime))
    for i, v in enumerate(speeds):
        at, rig = at_speed(v), TEXT(f"rig.{key}")
        for name, letter, values in (("environmental", "F_e", force.environmental), ("coulomb", "f_c", force.coulomb)):
            own = f"{key}_{name}_{slug(at)}"
            yield row("component", values[i], own=own, rig=rig, letter=letter, at=at)


def base_rows() -> Iterator[Row]:
    capsule, tissue, wall = Capsule(), Tissue(), WallConstants.from_set()
    yield from _components("base_default", capsule, tissue, "low", LOW_SPEEDS)
    section, length = wall_section(capsule, tissue), stretched_length(capsule)
    for u in (0.25e-3, 1e-3):
        tension, at = wall_tension(u, wall, section, length), f"{1e3 * u:g} mm"
        yield row("base_tension", tension, at, at=at)
    for v in (0.5e-3, 10e-3):
        drag, at = mucus_drag(v, tissue.mucus_thickness_m), at_speed(v)
        yield row("base_mucus", drag, at, at=at)


def viscoelastic_drawings() -> Iterator[Drawing]:
    top, jump = HIGH_SPEEDS[-1], HIGH_SPEEDS[0]
    v = np.linspace(0.2e-3, top, 480)
    low, blend = _force(v, "low"), _force(v, "blend")

    plot = Plot("speed, mm/s", "force, mN", yaxis_rangemode="tozero")
    parts = [
        (low.total, "total F", "printed"),
        (low.environmental, "environmental resistance F_e", "derived"),
        (low.coulomb, "Coulomb friction F_c", "third"),
        (low.viscous, "viscous resistance F_v", "fourth"),
    ]
    for values, name, colour in parts:
        plot.line(v * 1e3, values * MN, name, colour)
    _draw_band(plot)
    coulomb = load_set("zhang2014_viscoelastic_rig")["mean_coulomb_force_N"] * MN
    plot.points([0.5], [coulomb], "measured: weight alone, lumen held open (40.07 mN)", "diamond")
    yield plot.captioned("v_fig_5")

    slow, fast = np.linspace(0.2e-3, jump, 100), np.linspace(jump, top, 120)
    plot = Plot("speed, mm/s", "force, mN")
    plot.line(slow * 1e3, _force(slow, "low").total * MN, "low-speed moduli (Eq. 13)", "printed")
    plot.line(fast * 1e3, _force(fast, "high").total * MN, "high-speed moduli (Table 3)", "derived")
    plot.line(v * 1e3, blend.total * MN, "blend over 2 mm/s", "third", "dot")
    _draw_band(plot)
    yield plot.captioned("v_fig_7", drop=float(_force(jump, "low").total) - float(_force(jump, "high").total))

    plot = Plot("speed, mm/s", "force, mN", yaxis_rangemode="tozero")
    plot.line(v * 1e3, blend.total * MN, "theory (blend of both sets)", "printed")
    plot.line(v * 1e3, (blend.environmental + blend.viscous) * MN, "without the Coulomb part", "printed", "dot")
    _draw_band(plot)
    yield plot.captioned("v_fig_9")


def _force(speed: Any, regime: Regime) -> Resistance:
    capsule, tissue = viscoelastic_rig()
    return sliding_resistance(speed, capsule, replace(tissue, regime=regime))


def _draw_band(plot: Plot) -> None:
    valley, peak = (f * MN for f in measured_band())
    half, colour = (peak - valley) / 2, COLOURS["measured"]
    name = f"measured at 10 mm/s with C's capsule of 3.9 g:<br>{valley:.0f} to {peak:.0f} mN (A Section 5.1)"
    spread = {"type": "data", "array": [half], "thickness": 2, "width": 8, "color": colour}
    plot.points([BAND_SPEED * 1e3], [valley + half], name, error_y=spread)
