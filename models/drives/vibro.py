"""An inner mass on a spring between stops, pushed by a coil: the vibro-impact drive (capsubot) in the gut or on a
plate.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Final

import casadi as ca
import numpy as np

from models.drives.coil import Winding
from models.drives.drive import Actuation, Drive, Push, Values
from models.formula import Formula, Line, called, equal, symbols
from models.parameter import Parameter
from models.theta import Theta


@dataclass(frozen=True)
class Stop:
    """An elastic stop that the inner mass reaches after `gap_m`: `k (r - gap)` beyond it."""

    gap_m: float
    stiffness_N_per_m: float

    def force(self, beyond: Any) -> Any:
        """Force in N that pushes back at `beyond` = displacement towards the stop in m."""
        return self.stiffness_N_per_m * np.maximum(beyond - self.gap_m, 0.0)


@dataclass(frozen=True)
class Vibro(Drive):
    """Command `on` from 0 to 1: force `F on` on the inner mass, `m w' = F - S(r, r')`, on the body `S - a F`.

    `S = k r + c r' + front stop - rear stop` on the displacement r = inner mass - body; a = 1 where the coil sits on
    board (`reaction_on_body`), 0 where an external field acts on the magnet alone. The step is implicit in the
    suspension (trapezoidal, linearised at its predicted middle), so stiff stops and long steps stay stable, and the
    body's set-valued friction is solved with the inner mass's share of inertia.
    """

    name: ClassVar[str] = "vibro"
    commanded: ClassVar[str] = "drive_on"
    measured: ClassVar[str] = "position_m"
    states: ClassVar[tuple[str, ...]] = ("stretch_m", "rate_m_s")
    turning: ClassVar[bool] = True
    held: ClassVar[bool] = True
    inner_mass_kg: float = 0.074
    spring_stiffness_N_per_m: float = 256.23
    spring_damping_N_s_per_m: float = 0.0
    force_N: float = 1.25
    reaction_on_body: bool = True
    front: Stop | None = None
    rear: Stop | None = None

    @property
    def carried_kg(self) -> float:
        return self.inner_mass_kg

    def parameters(self) -> tuple[Parameter, ...]:
        k, c = self.spring_stiffness_N_per_m, self.spring_damping_N_s_per_m
        return (
            Parameter.near("force_N", self.force_N, "N", 0.7, 1.4, "rig file; several percent off"),
            Parameter.near("spring_stiffness_N_per_m", k, "N/m", 0.8, 1.25, "rig file"),
            Parameter("spring_damping_N_s_per_m", c, "N s/m", 0.0, max(2 * c, 1.0), "rig file"),
        )

    def equations(self, p: Values) -> list[Line]:
        F_act, S, F, r, rate, w = symbols("F_act S F r r' w'")
        spring = p["spring_stiffness_N_per_m"] * r + p["spring_damping_N_s_per_m"] * rate
        if self.front is not None or self.rear is not None:
            spring = spring + Formula("stops")
        return [
            [equal(F_act, S - F if self.reaction_on_body else S), ", ", equal(S, spring)],
            [equal(self.inner_mass_kg * w, F - S), ", ", equal(F, self._pushing(p))],
        ]

    def _pushing(self, p: Values) -> Any:
        return p["force_N"] * called("on", Formula("t"))

    def suspension(self, stretch: Any, rate: Any, p: Values) -> Any:
        """Force `S` in N that pulls the inner mass back at `stretch` in m and `rate` in m/s."""
        force = p["spring_stiffness_N_per_m"] * stretch + p["spring_damping_N_s_per_m"] * rate
        if self.front is not None:
            force = force + self.front.force(stretch)
        return force if self.rear is None else force - self.rear.force(-stretch)

    def field(self, at: Actuation) -> tuple[Any, dict[str, Any]]:
        """Mean force in N of the coil on the inner mass over the step, and the coil's own states at its end."""
        return at.p["force_N"] * at.command, {}

    def push(self, at: Actuation) -> Push:
        m, h, stretch, rate = self.inner_mass_kg, at.h, at.z["stretch_m"], at.z["rate_m_s"]
        middle = stretch + 0.5 * h * rate
        r, w = ca.SX.sym("r"), ca.SX.sym("w")
        law = self.suspension(r, w, at.p) + at.suspension(r, w)
        slope = 0.5 * h * ca.gradient(law, r) + ca.gradient(law, w)
        S, g = (ca.substitute(e, ca.vertcat(r, w), ca.vertcat(middle, rate)) for e in (law, slope))
        explicit = S - 0.5 * g * rate
        F, states = self.field(at)
        F = F * at.gain * at.reach(middle)
        beta = 0.5 * h * g
        reaction = F if self.reaction_on_body else 0.0
        force = explicit - reaction + (0.5 * g * m * rate + beta * (F - explicit)) / (m + beta)

        def after(v_next: Any, v_mean: Any) -> dict[str, Any]:
            inner = at.start + rate
            inner_next = (m * inner + h * (F - explicit) + beta * v_next) / (m + beta)
            moved = 0.5 * h * (inner + inner_next) - h * v_mean
            return states | {"stretch_m": stretch + moved, "rate_m_s": inner_next - v_next}

        return Push(force, beta * m / (m + beta), after)


@dataclass(frozen=True)
class RatedVibro(Vibro):
    """The same drive commanded by its coil's voltage: force F at the rated voltage, in proportion below, at once."""

    commanded: ClassVar[str] = "coil_voltage_V"
    rated_voltage_V: float = 12.0

    @property
    def command_unit(self) -> float:
        return self.rated_voltage_V


@dataclass(frozen=True)
class VoltageVibro(Vibro):
    """The same drive commanded by its coil's voltage: force `K i` of the current behind R, L and back-EMF."""

    commanded: ClassVar[str] = "coil_voltage_V"
    states: ClassVar[tuple[str, ...]] = ("stretch_m", "rate_m_s", "current_A")
    by_voltage: ClassVar[bool] = True
    leaves_open: ClassVar[tuple[str, ...]] = ("start", "resistance")
    coil_force_N_per_A: float = 0.5
    winding: Winding = Winding()

    def equations(self, p: Values) -> list[Line]:
        return [*super().equations(p), self.winding.equation(p, "r'")]

    def _pushing(self, p: Values) -> Any:
        return p["coil_force_N_per_A"] * Formula("i")

    def parameters(self) -> tuple[Parameter, ...]:
        k, source = self.coil_force_N_per_A, "rig file; several percent off"
        gain = Parameter.near("coil_force_N_per_A", k, "N/A", 0.7, 1.4, source)
        return (gain, *super().parameters()[1:], *self.winding.parameters())

    def field(self, at: Actuation) -> tuple[Any, dict[str, Any]]:
        mean, end = self.winding.current(at.z["current_A"], at.command, at.z["rate_m_s"], at.h, at.p)
        return at.p["coil_force_N_per_A"] * mean, {"current_A": end}


_LOADED: Final = ("force_N", "friction_coefficient")  # what a `load_scale` multiplies


def unloaded(values: Theta) -> Theta:
    """`values` with their `load_scale` multiplied into force and friction, if given."""
    left = dict(values.base)
    scale = left.pop("load_scale", 1.0)
    return Theta({name: scale * value if name in _LOADED else value for name, value in left.items()}, values.effects)
