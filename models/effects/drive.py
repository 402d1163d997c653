"""Effects of the drive: lag, backlash, dead zone, coupling, coil."""

from typing import Any, ClassVar

import numpy as np

from models.drives.elastic_link import Link
from models.effects.effect import Effect, Forms, InnerMassEffect, Signals, Value, Values, by_name, number
from models.effects.friction import DriftInTime, drift
from models.effects.inner_mass import TRAVEL_M
from models.formula import Formula, at_least, equal, named, polynomial, shown_as, symbols


class ActuatorLag(Effect):
    """Lag `tau c' = command - c`, exact for a ramp within the step."""

    id = "actuator_lag"
    words = "a lagging drive"
    summary = "first-order lag of the drive"
    source = "first-order drive"
    symbols = by_name(time_s="tau", command="u")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    states = ("command",)
    follows = by_name(command="command")
    probe = 0.005
    confounders: ClassVar[tuple[str, ...]] = ("sensor_delay", "sensor_lowpass", "carriage_backlash", "coil_lag")
    separated_by = "time-stamped edges; phase against frequency"
    refined_by: ClassVar[tuple[str, ...]] = ("sensor_delay", "further_lag")

    time_s = number(0.0, "s", 0.0, 1.0)

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
    """Backlash as a Duhem operator: of a change `dc` of the command the carriage follows `dc (e^(k q^n) - 1)/(e^k -
    1)`, `q` from 0 to 1 how far it is through the play `b` in the direction of `dc`. A large `k` is the loose nut,
    which does not move before `q = 1`; a small one an elastic seat that gives way gradually, from its begin on (`n =
    1`) or late: at `k = 0` it is `dc q^n`.
    """

    id = "carriage_backlash"
    words = "a drive with backlash"
    summary = "play in the drive"
    source = "tracing catalogue 18; backlash-like hysteresis, Su et al., IEEE TAC 45 (2000) 2427"
    symbols = by_name(play_m="b", sharpness="k", order="n", position_m="u")
    kinds = frozenset({"pull", "magnetic"})
    needs = ("reversals",)
    states = ("position_m",)
    follows = by_name(position_m="command")
    grid = by_name(sharpness=(3.0, 30.0), order=(1.2,))
    probe = 0.0003
    confounders = ("directional_asymmetry", "actuator_lag", "sensor_delay")
    separated_by = "reversals at several amplitudes"

    play_m = number(0.0, "m", 0.0, 0.008, "tracing catalogue 18")
    sharpness = number(10.0, "1", 0.0, 60.0, "from an elastic seat to a loose nut")
    order = number(1.0, "1", 1.0, 4.0, "a seat that stiffens", spread=1.0)

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
    """The rig pulls through `models.drives.elastic_link.Link`; the model makes the capsule a free mass behind it."""

    id = "string_compliance"
    words = "an elastic string"
    summary = "an elastic link between rig and capsule"
    source = "tracing catalogue 29"
    symbols = by_name(compliance_m_per_N="c", hardening_per_m="b", damping_N_s_per_m="d")
    kinds = frozenset({"pull"})
    probe = 0.001
    confounders = ("carriage_backlash", "small_strain_stiffening")
    separated_by = "change the length of the string"

    compliance_m_per_N = number(0.0, "m/N", 0.0, 0.02)
    hardening_per_m = number(100.0, "1/m", 0.0, 2000.0, "threads stiffen as they stretch")
    damping_N_s_per_m = number(0.02, "N s/m", 0.0, 0.3, "loss within the thread")

    def link(self, p: Values) -> Link:
        return Link(*(p[name.name] for name in self.parameters()))

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        e, rate, F = symbols("e e' F_link")
        c, b, d = (p[parameter.name] for parameter in cls.parameters())
        return {"link": [equal(F, np.sinh(b * e) / (b * c) + d * rate)]}


class CouplingDecay(Effect):
    """Drive gain `1 + g x + b x^2`."""

    id = "coupling_decay"
    words = "a coupling that changes along the track"
    summary = "the magnet's grip changes along the track"
    source = "tracing catalogue 23"
    symbols = by_name(slope_per_m="g", bend_per_m2="b")
    kinds = frozenset({"magnetic", "coil"})
    needs = ("places",)
    probe = 1.0
    confounders = ("lumen_taper",)
    separated_by = "the drive off: a taper stays"

    slope_per_m = number(0.0, "1/m", -30.0, 30.0)
    bend_per_m2 = number(0.0, "1/m^2", -600.0, 600.0)

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return at_least(polynomial(s.x, 1, p["slope_per_m"], p["bend_per_m2"]), 0.05)


class CouplingFade(DriftInTime):
    """Drive gain `1 + b s + c s^2` in a time s that settles."""

    id = "coupling_fade"
    words = "a coupling that fades with time"
    summary = "the drive's grip changes with time"
    source = "tracing catalogue 20"
    kinds = frozenset({"magnetic", "coil", "vibro"})
    needs = ("time",)
    confounders = ("tissue_drying",)
    separated_by = "an idle pause; logged current"

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return drift(s.t, p)


class ActuatorDeadZone(Effect):
    """Command `sgn(u) max(|u| - d, 0)`."""

    id = "actuator_dead_zone"
    words = "a dead zone of the drive"
    summary = "a dead zone of the drive"
    source = "tracing catalogue 17"
    symbols = by_name(zone="d")
    kinds = frozenset({"coil"})
    probe = 0.01
    confounders = ("stribeck", "dwell_adhesion")
    separated_by = "small-signal drive"

    zone = number(0.0, "of the command", 0.0, 1.0)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return np.sign(s.command) * np.maximum(np.abs(s.command) - p["zone"], 0.0)


class ActuatorSaturation(Effect):
    """Gain `1/(1 + a u^2)`, cubic loss at small drive."""

    id = "actuator_saturation"
    words = "a saturating drive"
    summary = "saturation of the drive"
    source = "tracing catalogue 19"
    symbols = by_name(inverse_square="a")
    kinds = frozenset({"coil"})
    probe = 0.5
    confounders = ("actuator_dead_zone",)
    separated_by = "amplitude staircase"

    inverse_square = number(0.0, "1/command^2", 0.0, 100.0)

    def gain(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 / (1 + p["inverse_square"] * s.command**2)


class MagneticHysteresis(Effect):
    """Command `u + r z`, `z' = u'/w` while |z| < 1, else held there: a loop of height 2 r whose branches meet over the
    width 2 w.

    r < 0 where the falling branch is the upper one, as in iron; r > 0 where it is the lower one.
    """

    id = "magnetic_hysteresis"
    words = "a magnetic hysteresis"
    summary = "the drive's force depends on whether its current rose or fell"
    source = "tracing catalogue 22: play in the current (Prandtl's stop, one element of Preisach's model)"
    symbols = by_name(remanence="r", width="w", memory="z")
    kinds = frozenset({"coil"})
    needs = ("reversals",)
    states = ("memory",)
    grid = by_name(width=(0.005, 0.05, 0.5))
    probe = 0.01
    confounders = ("actuator_lag", "directional_asymmetry", "stribeck")
    separated_by = "the force on a blocked capsule while the current goes up and down slowly"

    remanence = number(0.0, "command", -2.0, 2.0)
    width = number(0.05, "command", 0.001, 5.0)

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command + p["remanence"] * z["memory"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        return {"memory": np.clip(z["memory"] + s.rate * h / p["width"], -1.0, 1.0)}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"memory": [equal(Formula("z'"), s.rate / p["width"]), np.abs(z["memory"]) <= 1]}


class BackEmf(Effect):
    """Command `u - K v`: a coil driven by a voltage loses K volt for each m/s (K/R ampere of an asked-for current)."""

    id = "back_emf"
    words = "a back-EMF of the coil"
    summary = "the moving magnet takes voltage from the coil that drives it"
    source = "tracing catalogue 21: i = (u - K v)/R"
    symbols = by_name(loss_s_per_m="K")
    kinds = frozenset({"coil"})
    probe = 0.5
    confounders = ("viscous_drag", "actuator_lag")
    separated_by = "a measured current in place of the voltage: back-EMF goes, drag of the tissue stays"

    loss_s_per_m = number(0.0, "of the command's unit a m/s", 0.0, 60.0, "tracing catalogue 21; 0 to 60 V s/m")

    def command(self, s: Signals, p: Values, z: Values) -> Value:
        return s.command - p["loss_s_per_m"] * s.v


_OFF = 1e-12  # share of the force below which the coil counts as off: the root's slope stays finite


class CoilLag(InnerMassEffect):
    """`tau i' = sqrt(u) - i` (tau = L/R) and force `F i^2`: half of it after 1.23 tau on the rise, after 0.35 tau on
    the fall, so the drive is on for 0.88 tau less than its duty says. A command u between off (0) and on (1) is a share
    of the force.
    """

    id = "coil_lag"
    words = "a lagging coil current"
    summary = "the coil's current lags the switch; the force goes with its square"
    source = "reluctance coil F = i^2/2 dL/dx, literature 2.1"
    symbols = by_name(time_s="tau", current="i")
    kinds = frozenset({"vibro", "vibro_table"})
    states = ("current",)
    probe = 0.002
    confounders = ("actuator_lag", "coil_reach", "incline_gravity")
    separated_by = "the coil's current on an oscilloscope"

    time_s = number(0.0, "s", 0.0, 0.015, "coil with R 100 ohm: milliseconds")

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
    """Force `F exp(g xi)`, as of a coil whose inductance falls exponentially along it, `F = i^2/2 |dL/dxi|`, within 30
    mm.

    It acts only while the coil is on, so forward and backward differ; `g < 0` where the push carries the mass out of
    the field.
    """

    id = "coil_reach"
    words = "a coil force that depends on displacement"
    summary = "the coil's force changes with the inner mass's displacement"
    source = "reluctance coil, literature 1.2"
    symbols = by_name(gain_per_m="g")
    kinds = frozenset({"vibro", "vibro_table"})
    probe = 10.0
    confounders = ("coil_lag", "directional_asymmetry")
    separated_by = "the static force of the coil over displacement"

    gain_per_m = number(0.0, "1/m", -60.0, 60.0, "a factor of e over 16 mm")

    def reach(self, stretch: Value, p: Values) -> Value:
        return np.exp(p["gain_per_m"] * shown_as(np.clip(stretch, -TRAVEL_M, TRAVEL_M), lambda: stretch))
