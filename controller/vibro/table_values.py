"""What close-loop writes of a table of runs (`vibro_table`), turned into the rig and the values of a drive in time."""

from dataclasses import replace

from models.rigs.rig import Rig
from models.theta import Theta

LOADED = ("force_N", "friction_coefficient")


def in_time(rig: Rig, values: Theta) -> tuple[Rig, Theta]:
    """The `vibro` rig with the table's masses in kg, and the values that its control model takes.

    `load_scale` multiplies force and friction alike. `mirror` says how the record counted speeds and is left to whoever
    compares with that record; here +x is where the drive's force pushes the inner mass. Raises ValueError for a rig
    without an inner mass, or masses that are not positive.
    """
    if rig.drive is None:
        raise ValueError(f"rig must have an inner mass for the values of a vibro_table; got a {rig.kind} rig")
    table = ("mirror", "body_mass_kg", "inner_mass_kg")
    left = {name: value for name, value in unloaded(values).base.items() if name not in table}
    body = values.get("body_mass_kg", rig.capsule.mass_kg)
    inner = values.get("inner_mass_kg", rig.drive.inner_mass_kg)
    if not (body > 0 and inner > 0):
        raise ValueError(f"masses must be positive; got body_mass_kg = {body:g} and inner_mass_kg = {inner:g}")
    return replace(
        rig, capsule=replace(rig.capsule, mass_kg=body), drive=rig.drive.model_copy(update={"inner_mass_kg": inner})
    ), Theta(left, values.effects)


def unloaded(values: Theta) -> Theta:
    """`values` with their `load_scale` multiplied into force and friction, where these are given."""
    left = dict(values.base)
    scale = left.pop("load_scale", 1.0)
    base = {name: scale * value if name in LOADED else value for name, value in left.items()}
    return Theta(base, values.effects)
