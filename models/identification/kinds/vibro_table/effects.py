"""The effects on a table of mean speeds in their own ranges, and the fields of the compiled drive that hold them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from models.effects import variants_on
from models.identification.kinds.vibro_table.solver import GRAVITY, VibroCycle
from models.parameter import Name
from models.rigs.benches import VIBRO_TABLE
from models.theta import Theta, spelled

VARIANTS: Final = variants_on(VIBRO_TABLE.id)

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
