"""Effects of the drive: lag, backlash, dead zone, coupling, coil."""

from typing import Any

import numpy as np

from models.drives.elastic_link import Link
from models.effects.effect import Effect, Forms, InnerMassEffect, Signals, Value, Values, by_name
from models.effects.friction import DriftInTime, drift
from models.effects.inner_mass import TRAVEL_M
from models.formula import Formula, at_least, equal, named, polynomial, shown_as, symbols


class ActuatorLag(Effect):
    """First-order lag `tau u' = u_cmd - u`, exact for a ramp within the step."""

    id = "actuator_lag"
    states = ("command",)
    follows = by_name(command="command")

    def command(self, s: Signals, p: Values, z: Values) -> Any:
        return z["command"]

    def response(self, p: Values) -> Any:
        return p["time_s"]

    def advance(self, s: Signals, p: Values, z: Values, h: Any) -> dict[str, Any]:
        tau = np.maximum(p["time_s"], 1e-9)
        rise = p["time_s"] * (1 - np.exp(-h / tau))
        start = s.command - s.rate * h
        return {"command": s.command - s.rate * rise + (z["command"] - start) * np.exp(-h / tau)}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"command": [equal(p["time_s"] * Formula("u'"), s.command - z["command"])]}


_SMALLEST = 1e-4  # sharpness, below which the share differs from its limit by less than that


class CarriageBacklash(Effect):
    """Backlash as Duhem's operator: of a change du_cmd the carriage follows `du_cmd (e^(k q^n) - 1)/(e^k - 1)`, q from
    0 to 1 its position within the play b.

    A large k is a loose nut, which does not move before q = 1. A small k is an elastic seat that gives way gradually,
    from the beginning (n = 1) or late; at k = 0 it is `du_cmd q^n`.
    """

    id = "carriage_backlash"
    states = ("position_m",)
    follows = by_name(position_m="command")

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return z["position_m"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        half, change, k = p["play_m"] / 2, s.rate * h, np.maximum(p["sharpness"], _SMALLEST)
        ahead = (s.command - 0.5 * change - z["position_m"]) * np.sign(change)
        through = np.clip(0.5 + 0.5 * ahead / np.maximum(half, 1e-9), 0.0, 1.0)
        share = (np.exp(k * through ** p["order"]) - 1) / (np.exp(k) - 1)
        return {"position_m": np.clip(z["position_m"] + change * share, s.command - half, s.command + half)}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        k, behind = p["sharpness"], s.command - z["position_m"]
        q = named("q", 1 / Formula.of(2) + behind * np.sign(s.rate) / p["play_m"])
        law = equal(Formula("u'"), s.rate * (np.exp(k * q ** p["order"]) - 1) / (np.exp(k) - 1))
        return {"position_m": [law, np.abs(behind) <= p["play_m"] / 2]}


class StringCompliance(Effect):
    """The rig pulls through `models.drives.elastic_link.Link`, force `sinh(b e)/(b c) + d e'` at the stretch e; the
    capsule is a free mass behind it.
    """

    id = "string_compliance"

    def link(self, p: Values) -> Link:
        return Link(*(p[name.name] for name in self.parameters()))

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        e, rate, F = symbols("e e' F_link")
        c, b, d = (p[parameter.name] for parameter in cls.parameters())
        return {"link": [equal(F, np.sinh(b * e) / (b * c) + d * rate)]}


class CouplingDecay(Effect):
    """Scale `1 + g x + b x^2` of the drive's force."""

    id = "coupling_decay"

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return at_least(polynomial(s.x, 1, p["slope_per_m"], p["bend_per_m2"]), 0.05)


class CouplingFade(DriftInTime):
    """Scale `1 + b t_e + c t_e^2` of the drive's force, over a time that settles."""

    id = "coupling_fade"

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return drift(s.t, p)


class ActuatorDeadZone(Effect):
    """Command `sgn(u_cmd) max(|u_cmd| - d, 0)`."""

    id = "actuator_dead_zone"

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return np.sign(s.command) * np.maximum(np.abs(s.command) - p["zone"], 0.0)


class ActuatorSaturation(Effect):
    """Scale `1/(1 + a u_cmd^2)` of the drive's force: a cubic loss at small drive."""

    id = "actuator_saturation"

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 / (1 + p["inverse_square"] * s.command**2)


class MagneticHysteresis(Effect):
    """Command `u_cmd + r z`, `z' = u_cmd'/w` within |z| <= 1 (Prandtl's stop): a loop of height 2 r whose branches meet
    over the width 2 w.

    r < 0 where the falling branch is the upper one, as in iron; r > 0 where it is the lower one.
    """

    id = "magnetic_hysteresis"
    states = ("memory",)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command + p["remanence"] * z["memory"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        return {"memory": np.clip(z["memory"] + s.rate * h / p["width"], -1.0, 1.0)}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"memory": [equal(Formula("z'"), s.rate / p["width"]), np.abs(z["memory"]) <= 1]}


class BackEmf(Effect):
    """Command `u_cmd - K v`: a coil under a voltage loses K volt for each m/s (K/R ampere of a commanded current)."""

    id = "back_emf"

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command - p["loss_s_per_m"] * s.v


_OFF = 1e-12  # share of the force below which the coil counts as off: the root's slope stays finite


class CoilLag(InnerMassEffect):
    """Current `tau i' = sqrt(u_cmd) - i`, `tau = L/R`, and force `F i^2`. Half of the force is there after 1.23 tau on
    the rise and after 0.35 tau on the fall: the drive is on for 0.88 tau less than its duty says.

    A command between off (0) and on (1) is a share of the force.
    """

    id = "coil_lag"
    states = ("current",)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return z["current"] ** 2

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        kept = np.exp(-h / np.maximum(p["time_s"], 1e-9))
        final = np.sqrt(np.maximum(s.command, _OFF))
        return {"current": final + (z["current"] - final) * kept}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"current": [equal(p["time_s"] * Formula("i'"), np.sqrt(s.command) - z["current"])]}


class CoilReach(InnerMassEffect):
    """Scale `exp(g xi)` of the coil's force within 30 mm, as of a coil whose inductance falls exponentially along it,
    `F = i^2/2 |dL/dxi|`.

    It acts while the coil is on, so forward and backward differ; g < 0 where the push carries the mass out of the
    field.
    """

    id = "coil_reach"

    def reach(self, stretch: Value, p: Values) -> Value:
        return np.exp(p["gain_per_m"] * shown_as(np.clip(stretch, -TRAVEL_M, TRAVEL_M), lambda: stretch))
