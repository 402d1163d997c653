"""A kind of rig that nobody here knows: a jet drives a capsule along a slab, and the capsule's place is measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from models.drives.drive import Drive
from models.formula import Formula, Line, called, equal, symbols
from models.laws.geometry import GRAVITY
from models.parameter import Parameter
from models.rigs.columns import Columns, Range
from models.rigs.kind import Array, RigKind, Tables
from models.rigs.kind import Record as Rows
from models.rigs.schema import Positive, Table, key
from models.rigs.tables import BodyTable, SurfaceTable
from models.surfaces.surface import Levels, Surface, Values

MASS_KG, THRUST, MU, NOISE_M = 0.02, 0.8, 0.3, 1e-3


@dataclass(frozen=True)
class Thruster(Drive):
    """A jet that pushes with a force in proportion to its command."""

    name: ClassVar[str] = "thruster"
    commanded: ClassVar[str] = "jet"
    measured: ClassVar[str] = "position_m"
    thrust_N: float = 1.0

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("thrust_N", self.thrust_N, "N", 0.5, 2.0, "data sheet", fit=True),)

    def force(self, x: Any, v: Any, command: Any, p: Mapping[str, Any]) -> Any:
        return p["thrust_N"] * command

    def command_for(self, force: Any, x: Any, v: Any, p: Mapping[str, Any]) -> Any:
        return force / p["thrust_N"]

    def equations(self, p: Mapping[str, Any]) -> list[Line]:
        return [[equal(Formula("F_act"), p["thrust_N"] * Formula("jet"))]]


@dataclass(frozen=True)
class Slab(Surface):
    """Coulomb friction whose coefficient is known and not fitted."""

    mass_kg: float

    @property
    def body_kg(self) -> float:
        return self.mass_kg

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("slab_friction", MU, "1", 0.1, 1.0, "known"),)

    def hold(
        self,
        speed: Any,
        p: Values,
        carried_kg: float = 0.0,
        levels: Levels = (1.0, 1.0, 1.0),
        pressing: Any = 0.0,
    ) -> tuple[Any, Any]:
        return p["slab_friction"] * ((self.mass_kg + carried_kg) * GRAVITY + pressing) * levels[0], 0.0

    def equations(self, p: Values) -> list[Line]:
        m, a, F_act, g, v = symbols("m a F_act g v")
        return [[equal(m * a, F_act - p["slab_friction"] * m * g * called("Sgn", v))]]


class JetTable(Table):
    """`[jet]`: what the jet is."""

    thrust_N: Positive = key("thrust of the jet where it is fully open", example="1.0")


def glided(t: Array, jet: Array, drag_N_s_per_m: float = 0.0) -> Array:
    """Place (n,) in m of the capsule at the times `t` (n,) under the opening `jet` (n,), with a drag that the base
    model lacks.
    """
    x, v, places, h = 0.0, 0.0, [], float(t[1] - t[0]) / 20
    slip = MU * MASS_KG * GRAVITY
    for opening in jet:
        places.append(x)
        for _ in range(20):
            pushed = v + h * (THRUST * opening - drag_N_s_per_m * v) / MASS_KG
            v = np.sign(pushed) * max(abs(pushed) - h * slip / MASS_KG, 0.0)
            x += h * v
    return np.array(places)


def bursts(rng: np.random.Generator, seconds: float = 8.0, drag_N_s_per_m: float = 0.0) -> Rows:
    """The columns of a record of bursts to and fro."""
    t = np.arange(0, seconds, 5e-3)
    size = np.repeat(rng.uniform(0.09, 0.25, 1 + int(seconds)), 200)[: t.size]
    jet = np.where(t < 0.5, 0.0, size * np.sin(2 * np.pi * 0.5 * (t - 0.5)))
    place = glided(t, jet, drag_N_s_per_m) + NOISE_M * rng.standard_normal(t.size)
    return {"t_s": t, "jet": jet, "position_m": place}


def _template(rng: np.random.Generator) -> tuple[Tables, Rows]:
    """Bursts of a jet that is a fifth weaker than its data sheet says."""
    return TABLES, bursts(rng)


TABLES: Tables = {
    "rig": {"kind": "thruster"},
    "capsule": {"mass_kg": MASS_KG},
    "jet": {"thrust_N": 1.0},
    "surface": {"kind": "plate", "friction_coefficient": MU},
    "noise": {"position_std_m": NOISE_M},
}
THRUSTER = RigKind(
    id="thruster",
    layouts=(Columns((("jet",),), ("position_m",)),),
    ranges={"jet": Range(-1.0, 1.0, "between -1 (back) and 1 (forth)")},
    tables={"capsule": BodyTable, "jet": JetTable, "surface": SurfaceTable},
    drive=lambda rig, by_voltage: Thruster(rig.own["jet"].thrust_N),
    template=_template,
    effects=frozenset({"viscous_drag", "stribeck"}),
)
