"""Paper V: force against speed, friction coefficient, and the moduli over strain; and the base model's check values."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hil.app.papers.row import Row, Verdict, row, speed_key
from models.laws.five_elements import low_speed_moduli
from models.laws.geometry import GRAVITY, Capsule, Regime, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants, wall_tension
from models.laws.resistance import mucus_drag, sliding_resistance
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
    """Every line about paper V's force-speed model."""
    capsule, tissue = viscoelastic_rig()
    s = load_set("zhang2014_viscoelastic_rig")
    mu = s["mean_coulomb_force_N"] / (capsule.mass_kg * GRAVITY)
    note = "40.07 mN over the weight of 50.1 g, in a lumen held open"
    quantity = "V: friction coefficient"
    yield row("v_friction_coefficient", quantity, "1", mu, "reproduced", note, paper=s["friction_coefficient"])
    yield from _band(capsule, tissue)
    yield from _shares(capsule, tissue)
    yield from _components("v_low", "V, low-speed moduli", capsule, tissue, "low", LOW_SPEEDS)
    yield from _components("v_high", "V, high-speed moduli", capsule, tissue, "high", HIGH_SPEEDS)
    yield _eq13_row()


def _band(capsule: Capsule, tissue: Tissue) -> Iterator[Row]:
    valley, peak = measured_band()
    force = sliding_resistance(BAND_SPEED, capsule, tissue)
    yield row("v_viscous_10_mm_s", "V: F_v at 10 mm/s", "mN", force.viscous, "check value", "mucus drag, V Eq. 9, 10")
    band = f"{valley * 1e3:.0f} to {peak * 1e3:.0f} mN (A Section 5.1)"
    note = (
        f"F_e + f_c + F_v of V's dummy of {capsule.mass_kg * 1e3:.1f} g; it lies within the {band}, but those were"
        " measured with paper C's capsule of 3.9 g: of that, see the next row"
    )
    different: Verdict = "not comparable"
    yield row("v_total_10_mm_s", "V: total force at 10 mm/s", "mN", force.total, different, note)
    middle = (valley + peak) / 2
    c = load_set("zhang2014_constant_velocity")
    rig = replace(capsule, cylinder_length_m=c["cylinder_length_m"], mass_kg=c["mass_kg"])
    total = sliding_resistance(BAND_SPEED, rig, tissue).total
    note = (
        f"the capsule that was measured: 3.9 g, cylinder of 20 mm (33 mm in all), resin; {band}, middle shown; the"
        " friction coefficient is that of PDMS; the sum is the tip of a tooth in A's reading, the mean force in V's"
    )
    verdict: Verdict = "consistent" if valley <= total <= peak else "misses the measurement"
    quantity = "V: total force at 10 mm/s for C's capsule"
    yield row("v_total_10_mm_s_capsule_c", quantity, "mN", total, verdict, note, measured=middle)


def _shares(capsule: Capsule, tissue: Tissue) -> Iterator[Row]:
    """V's sentence that the environmental resistance has the major share of the force."""
    for v in LOW_SPEEDS:
        force = sliding_resistance(v, capsule, tissue)
        share = float(force.environmental / force.total)
        largest = bool(force.environmental > max(force.coulomb, force.viscous))
        verdict: Verdict = "consistent" if largest else "not reproducible"
        note = (
            "V says that F_e has the major share; by its own numbers F_c is the larger part from 0.5 to 20 mm/s"
            if not largest
            else "V says that F_e has the major share"
        )
        quantity = f"V: share of F_e at {v * 1e3:g} mm/s"
        yield row(f"v_share_environmental_{speed_key(v)}", quantity, "%", share, verdict, note)


def _components(
    prefix: str, name: str, capsule: Capsule, tissue: Tissue, regime: Regime, speeds: tuple[float, ...]
) -> Iterator[Row]:
    force = sliding_resistance(np.array(speeds), capsule, replace(tissue, regime=regime))
    for i, v in enumerate(speeds):
        at = f"at {v * 1e3:g} mm/s"
        quantity = f"{name}: F_e {at}"
        yield row(f"{prefix}_environmental_{speed_key(v)}", quantity, "mN", force.environmental[i], "check value")
        yield row(f"{prefix}_coulomb_{speed_key(v)}", f"{name}: f_c {at}", "mN", force.coulomb[i], "check value")


def _eq13_row() -> Row:
    table = load_measurement("viscoelastic_table1_relaxation")
    fitted = low_speed_moduli(table["shear_strain"])
    columns = {f"{name}_Pa": getattr(fitted, name) for name in ("E1", "E2", "E3")}
    columns |= {"eta1_Pa_s": fitted.eta1, "eta2_Pa_s": fitted.eta2}
    strain = table["shear_strain"]
    best = [np.polyval(np.polyfit(strain, table[name], 2), strain) / table[name] - 1 for name in columns]
    errors = [value / table[name] - 1 for name, value in columns.items()]
    rms, least = (float(np.sqrt(np.mean(np.square(e)))) for e in (errors, best))
    note = (
        "rms relative deviation of the twenty values, minus signs (lost in the text) restored so that Table 1 is met"
        f" best; least squares in the same quadratic form would leave {least:.1%}"
    )
    return row("v_eq13_against_table1", "V: Eq. 13 against Table 1", "%", rms, "consistent", note)


def base_rows() -> Iterator[Row]:
    """The base model's check values for the default capsule."""
    capsule, tissue, wall = Capsule(), Tissue(), WallConstants.from_set()
    yield from _components("base_default", "default capsule", capsule, tissue, "low", LOW_SPEEDS)
    section, length = wall_section(capsule, tissue), stretched_length(capsule)
    for key, u in (("0_25_mm", 0.25e-3), ("1_mm", 1e-3)):
        quantity = f"default capsule: T({u * 1e3:g} mm)"
        note = "A Eq. 12"
        yield row(f"base_tension_{key}", quantity, "mN", wall_tension(u, wall, section, length), "check value", note)
    for v in (0.5e-3, 10e-3):
        quantity = f"mucus drag at {v * 1e3:g} mm/s"
        note = "V Eq. 9, 10, film of 30 um"
        key = f"base_mucus_{speed_key(v)}"
        yield row(key, quantity, "mN", mucus_drag(v, tissue.mucus_thickness_m), "check value", note)
