"""A coil outside the body that pushes the capsule's magnet: force per current, and the current behind a voltage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np

from models.drives.drive import Actuation, Drive, Push, Values
from models.formula import Line, equal, named, symbols
from models.parameter import Parameter


@dataclass(frozen=True)
class Coil(Drive):
    """Current i in A; force `k i` in a uniform field, `k i/(1 + ((x - x_c)/r)^2)^2` where the field has a range r."""

    name: ClassVar[str] = "coil"
    commanded: ClassVar[str] = "coil_current_A"
    measured: ClassVar[str] = "position_m"
    force_constant_N_per_A: float = 0.5
    position_m: float = 0.0
    range_m: float | None = None

    def parameters(self) -> tuple[Parameter, ...]:
        k, source = self.force_constant_N_per_A, "rig file; several percent off"
        return (Parameter.near("coil_force_N_per_A", k, "N/A", 0.7, 1.3, source),)

    def equations(self, p: Values) -> list[Line]:
        F_act, i, x = symbols("F_act i x")
        force = p["coil_force_N_per_A"] * i
        if self.range_m is not None:
            force = force / (1 + ((x - named("x_c", self.position_m, x)) / named("r", self.range_m, x)) ** 2) ** 2
        return [[equal(F_act, force)]]

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        return force / self.force(x, v, 1.0, p)

    def force(self, x: Any, v: Any, command: Any, p: Values) -> Any:
        pull = p["coil_force_N_per_A"] * command
        return pull if self.range_m is None else pull / (1 + ((x - self.position_m) / self.range_m) ** 2) ** 2


@dataclass(frozen=True)
class Winding:
    """The electrical side of a coil: `L i' = U - R i - K_e w`, `|i|` within the supply's limit."""

    resistance_ohm: float = 10.0
    inductance_H: float = 10e-3
    current_limit_A: float = 1.0
    back_emf_V_s_per_m: float = 0.0

    @classmethod
    def of(cls, resistance: float, inductance: float | None, limit: float | None, force_constant: float) -> Winding:
        """A coil whose back-EMF constant equals its force constant, by conservation of power."""
        return cls(resistance, inductance or 0.0, float("inf") if limit is None else limit, force_constant)

    def parameters(self) -> tuple[Parameter, ...]:
        """Resistance and back-EMF. A record of positions shows only the ratio of resistance and force constant."""
        r, e = self.resistance_ohm, self.back_emf_V_s_per_m
        spread = max(abs(e), 0.1)
        return (
            Parameter("coil_resistance_ohm", r, "ohm", 0.5 * r, 2.0 * r, "rig file; copper warms by 0.4 % a kelvin"),
            Parameter("back_emf_V_s_per_m", e, "V s/m", e - spread, e + spread, "rig file; N/A in SI"),
        )

    def equation(self, p: Values, speed: str) -> Line:
        """The current's law; `speed` is the symbol of the speed behind the back-EMF."""
        L, rate, U, i, v = symbols(f"L i' U i {speed}")
        return [equal(L * rate, U - p["coil_resistance_ohm"] * i - p["back_emf_V_s_per_m"] * v)]

    def current(self, start: Any, voltage: Any, speed: Any, h: Any, p: Values) -> tuple[Any, Any]:
        """Mean current over a step `h` in s and current at its end, in A; exact at a constant `voltage` in V and
        `speed` in m/s.

        `start` is the current at the step's beginning. Without inductance the current follows at once.
        """
        final = (voltage - p["back_emf_V_s_per_m"] * speed) / p["coil_resistance_ohm"]
        most = self.current_limit_A
        if self.inductance_H == 0:
            final = np.clip(final, -most, most)
            return final, final
        turns = h * p["coil_resistance_ohm"] / self.inductance_H
        left = np.exp(-turns)
        mean = final + (start - final) * (1 - left) / turns
        return np.clip(mean, -most, most), np.clip(final + (start - final) * left, -most, most)


ELECTRICAL: Final = ("coil_force_N_per_A", *(p.name for p in Winding().parameters()))
"""Parameters that only records of a voltage have; a drive commanded otherwise lacks those that it does not declare."""


@dataclass(frozen=True)
class VoltageCoil(Coil):
    """The same coil driven by a voltage in V: the current is a state behind resistance, inductance and back-EMF."""

    commanded: ClassVar[str] = "coil_voltage_V"
    by_voltage: ClassVar[bool] = True
    leaves_open: ClassVar[tuple[str, ...]] = ("start", "resistance")
    states: ClassVar[tuple[str, ...]] = ("current_A",)
    winding: Winding = Winding()

    def equations(self, p: Values) -> list[Line]:
        return [*super().equations(p), self.winding.equation(p, "v")]

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        return p["coil_resistance_ohm"] * super().command_for(force, x, v, p) + p["back_emf_V_s_per_m"] * v

    def parameters(self) -> tuple[Parameter, ...]:
        return super().parameters() + self.winding.parameters()

    def push(self, at: Actuation) -> Push:
        mean, end = self.winding.current(at.z["current_A"], at.command, at.v, at.h, at.p)
        return Push(at.gain * self.force(at.x, at.v, mean, at.p), after=lambda *_: {"current_A": end})
