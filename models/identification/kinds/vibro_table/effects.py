"""The effects on a table of mean speeds in their own ranges, and the fields of the compiled drive that hold them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from models.effects.drive import ActuatorLag
from models.effects.effect import Effect, by_name, number
from models.effects.force import ViscousDrag
from models.effects.friction import DirectionalAsymmetry, Stribeck
from models.effects.inner_mass import EndStopImpact, SpringHardening
from models.identification.kinds.vibro_table.solver import GRAVITY, VibroCycle
from models.parameter import Name
from models.rigs.benches import VIBRO_TABLE
from models.theta import Theta, spelled


class SwitchLag(ActuatorLag):
    """`actuator_lag` of a coil that is switched on and off, milliseconds."""

    kinds = frozenset({VIBRO_TABLE.id})
    probe = 0.002
    confounders = ("coil_lag", "coil_reach", "incline_gravity")
    time_s = number(0.0, "s", 0.0, 0.015)


class SoftStop(EndStopImpact):
    """`end_stop_impact` of elastic rubber: mean speeds hardly show a short impact."""

    grid = by_name(gap_m=(0.005, 0.01, 0.015))
    stiffness_N_per_m = number(0.0, "N/m", 0.0, 3000.0, "rubber stops")
    gap_m = number(0.01, "m", 0.003, 0.03, "travel of the inner mass")
    loss_s = number(0.0, "s", 0.0, 5e-3, fit=False)


class Duffing(SpringHardening):
    """`spring_hardening` with the third power, the only one that mean speeds identify."""

    power = number(3.0, "1", 1.5, 5.0, fit=False)


class PlateDrag(ViscousDrag):
    """`viscous_drag` of a plate, never negative: a body would run away."""

    coefficient_N = number(0.0, "N at 10 mm/s", 0.0, 0.3)


class PlateStribeck(Stribeck):
    """`stribeck` of a dry plate: it fades over speeds of the body's own swing, up to 0.15 m/s."""

    grid = by_name(speed_m_s=(0.01, 0.03, 0.08))
    excess = number(0.0, "1", 0.0, 2.0)
    speed_m_s = number(0.03, "m/s", 0.002, 0.15)
    exponent = number(2.0, "1", 0.5, 4.0, fit=False)


class PlateAsymmetry(DirectionalAsymmetry):
    """`directional_asymmetry` of a plate."""

    asymmetry = number(0.0, "1", -0.4, 0.4, "directional friction of dry contacts: tens of percent")


VARIANTS: Final[tuple[type[Effect], ...]] = (SwitchLag, SoftStop, Duffing, PlateStribeck, PlateDrag, PlateAsymmetry)

FIELDS: Final[Mapping[Name, str]] = MappingProxyType(
    {
        ("spring_damping", "damping_N_s_per_m"): "damping",
        ("guide_friction", "friction_N"): "dry_N",
        ("coil_lag", "time_s"): "current_lag_s",
        ("actuator_lag", "time_s"): "force_lag_s",
        ("coil_reach", "gain_per_m"): "reach_per_m",
        ("spring_hardening", "cubic_N_per_m3"): "cubic",
        ("spring_hardening", "power"): "cubic_power",
        ("end_stop_impact", "stiffness_N_per_m"): "stop_stiffness",
        ("end_stop_impact", "gap_m"): "stop_gap_m",
        ("end_stop_impact", "loss_s"): "stop_loss_s",
        ("stribeck", "excess"): "stribeck",
        ("stribeck", "speed_m_s"): "stribeck_speed",
        ("stribeck", "exponent"): "stribeck_power",
        ("viscous_drag", "coefficient_N"): "drag_N",
        ("viscous_drag", "exponent"): "drag_power",
        ("directional_asymmetry", "asymmetry"): "asymmetry",
        ("incline_gravity", "force_N"): "incline_N",
    }
)
"""Field of `VibroCycle` for each parameter of an effect."""


def vibro_cycle(theta: Theta, reaction_on_body: bool = True) -> VibroCycle:
    """The drive at `theta`, the base values with `load_scale` (of force and friction alike) and effects. Raises
    ValueError for another effect.
    """
    body, inner = theta["body_mass_kg"], theta["inner_mass_kg"]
    given = Theta(effects=theta.effects)
    if unknown := [spelled(name) for name in given if name not in FIELDS]:
        known = ", ".join(map(spelled, FIELDS))
        raise ValueError(
            f"effect must be one that acts on a body with an inner mass; got {unknown[0]!r}; known: {known}"
        )
    extra = {FIELDS[name]: float(value) for name, value in given.items()}
    scale = theta.get("load_scale", 1.0)
    coulomb = theta["friction_coefficient"] * (body + inner) * GRAVITY
    stiffness, reaction = theta["spring_stiffness_N_per_m"], 1.0 if reaction_on_body else 0.0
    return VibroCycle(body, inner, stiffness, scale * theta["force_N"], scale * coulomb, reaction, **extra)
