"""Effects of the drive: lag, backlash, dead zone, coupling, coil."""

from typing import Any, ClassVar

import numpy as np

from models.drives.elastic_link import Link
from models.effects.effect import Effect, Forms, InnerMassEffect, Signals, Value, Values, by_name, number
from models.effects.friction import DriftInTime, drift
from models.effects.inner_mass import TRAVEL_M
from models.formula import Formula, at_least, equal, named, polynomial, shown_as, symbols


class ActuatorLag(Effect):
    """First-order lag `tau u' = u_cmd - u`, exact for a ramp within the step."""

    id = "actuator_lag"
    source = "first-order drive"
    symbols = by_name(command="u")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "driven_axis"})
    states = ("command",)
    follows = by_name(command="command")
    probe = 0.005
    confounders: ClassVar[tuple[str, ...]] = ("sensor_delay", "sensor_lowpass", "carriage_backlash", "coil_lag")
    refined_by: ClassVar[tuple[str, ...]] = ("sensor_delay", "further_lag")

    time_s = number(0.0, "s", 0.0, 1.0, symbol="tau")

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
    source = "tracing catalogue 18; backlash-like hysteresis, Su et al., IEEE TAC 45 (2000) 2427"
    symbols = by_name(position_m="u")
    kinds = frozenset({"pull", "magnetic"})
    needs = ("reversals",)
    states = ("position_m",)
    follows = by_name(position_m="command")
    grid = by_name(sharpness=(3.0, 30.0), order=(1.2,))
    probe = 0.0003
    confounders = ("directional_asymmetry", "actuator_lag", "sensor_delay")

    play_m = number(0.0, "m", 0.0, 0.008, "tracing catalogue 18", symbol="b")
    sharpness = number(10.0, "1", 0.0, 60.0, "from an elastic seat to a loose nut", symbol="k")
    order = number(1.0, "1", 1.0, 4.0, "a seat that stiffens", spread=1.0, symbol="n")

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
    """The rig pulls the capsule, a free mass, through a `Link`: force `sinh(b e)/(b c) + d e'` at the stretch e."""

    id = "string_compliance"
    source = "tracing catalogue 29"
    kinds = frozenset({"pull"})
    probe = 0.001
    confounders = ("carriage_backlash", "small_strain_stiffening")

    compliance_m_per_N = number(0.0, "m/N", 0.0, 0.02, symbol="c")
    hardening_per_m = number(100.0, "1/m", 0.0, 2000.0, "threads stiffen as they stretch", symbol="b")
    damping_N_s_per_m = number(0.02, "N s/m", 0.0, 0.3, "loss within the thread", symbol="d")

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
    source = "tracing catalogue 23"
    kinds = frozenset({"magnetic", "coil"})
    needs = ("places",)
    probe = 1.0
    confounders = ("lumen_taper",)

    slope_per_m = number(0.0, "1/m", -30.0, 30.0, symbol="g")
    bend_per_m2 = number(0.0, "1/m^2", -600.0, 600.0, symbol="b")

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return at_least(polynomial(s.x, 1, p["slope_per_m"], p["bend_per_m2"]), 0.05)


class CouplingFade(DriftInTime):
    """Scale `1 + b t_e + c t_e^2` of the drive's force, over a time that settles."""

    id = "coupling_fade"
    source = "tracing catalogue 20"
    kinds = frozenset({"magnetic", "coil", "vibro"})
    needs = ("time",)
    confounders = ("tissue_drying",)

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return drift(s.t, p)


class ActuatorDeadZone(Effect):
    """Command `sgn(u_cmd) max(|u_cmd| - d, 0)`."""

    id = "actuator_dead_zone"
    source = "tracing catalogue 17"
    kinds = frozenset({"coil", "driven_axis"})
    probe = 0.01
    confounders = ("stribeck", "dwell_adhesion", "actuator_saturation")

    zone = number(0.0, "of the command", 0.0, 1.0, symbol="d")

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return np.sign(s.command) * np.maximum(np.abs(s.command) - p["zone"], 0.0)


class ActuatorSaturation(Effect):
    """Scale `1/(1 + a u_cmd^2)` of the drive's force: a cubic loss at small drive."""

    id = "actuator_saturation"
    source = "tracing catalogue 19"
    kinds = frozenset({"coil", "driven_axis"})
    probe = 0.5
    confounders = ("actuator_dead_zone",)

    inverse_square = number(0.0, "1/command^2", 0.0, 100.0, symbol="a")

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 / (1 + p["inverse_square"] * s.command**2)


class MagneticHysteresis(Effect):
    """Command `u_cmd + r z`, `z' = u_cmd'/w` within |z| <= 1 (Prandtl's stop): a loop of height 2 r whose branches meet
    over the width 2 w.

    r < 0 where the falling branch is the upper one, as in iron; r > 0 where it is the lower one.
    """

    id = "magnetic_hysteresis"
    source = "tracing catalogue 22: play in the current (Prandtl's stop, one element of Preisach's model)"
    symbols = by_name(memory="z")
    kinds = frozenset({"coil"})
    needs = ("reversals",)
    states = ("memory",)
    grid = by_name(width=(0.005, 0.05, 0.5))
    probe = 0.01
    confounders = ("actuator_lag", "directional_asymmetry", "stribeck")

    remanence = number(0.0, "command", -2.0, 2.0, symbol="r")
    width = number(0.05, "command", 0.001, 5.0, symbol="w")

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
    source = "tracing catalogue 21: i = (u - K v)/R"
    kinds = frozenset({"coil"})
    probe = 0.5
    confounders = ("viscous_drag", "actuator_lag")

    loss_s_per_m = number(
        0.0, "of the command's unit a m/s", 0.0, 60.0, "tracing catalogue 21; 0 to 60 V s/m", symbol="K"
    )

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command - p["loss_s_per_m"] * s.v


_OFF = 1e-12  # share of the force below which the coil counts as off: the root's slope stays finite


class CoilLag(InnerMassEffect):
    """Current `tau i' = sqrt(u_cmd) - i`, `tau = L/R`, and force `F i^2`. Half of the force is there after 1.23 tau on
    the rise and after 0.35 tau on the fall: the drive is on for 0.88 tau less than its duty says.

    A command between off (0) and on (1) is a share of the force.
    """

    id = "coil_lag"
    source = "reluctance coil F = i^2/2 dL/dx, literature 2.1"
    symbols = by_name(current="i")
    kinds = frozenset({"vibro", "vibro_table"})
    states = ("current",)
    probe = 0.002
    confounders = ("actuator_lag", "coil_reach", "incline_gravity")

    time_s = number(0.0, "s", 0.0, 0.015, "coil with R 100 ohm: milliseconds", symbol="tau")

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
    source = "reluctance coil, literature 1.2"
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 10.0
    confounders = ("coil_lag", "directional_asymmetry")

    gain_per_m = number(0.0, "1/m", -60.0, 60.0, "a factor of e over 16 mm", symbol="g")

    def reach(self, stretch: Value, p: Values) -> Value:
        return np.exp(p["gain_per_m"] * shown_as(np.clip(stretch, -TRAVEL_M, TRAVEL_M), lambda: stretch))
