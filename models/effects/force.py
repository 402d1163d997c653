"""Effects that are forces on the capsule."""

import math
from typing import Any, ClassVar

import numpy as np

from models.effects.effect import Effect, Forms, Signals, Value, Values, by_name, number
from models.formula import Formula, equal, named, shown_as

_CREEP = 1e-6  # m/s
_STILL = 1e-12  # m/s, rate of a stretch that counts as none


class ViscousDrag(Effect):
    """Force `-c sgn(v) (|v|/10 mm/s)^n`: odd in speed, without memory."""

    id = "viscous_drag"
    source = "Tribol. Lett. 51:377; shear-thinning mucus n 0.3 to 0.6"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "friction"})
    needs = ("speeds",)
    grid = by_name(exponent=(0.5, 1.0, 1.5))
    probe = 0.002
    confounders = ("stribeck", "wall_viscosity", "back_emf")
    refined_by = ("level_over_speed",)

    coefficient_N = number(0.0, "N at 10 mm/s", 0.0, 0.3, symbol="c")
    exponent = number(1.0, "1", 0.4, 2.0, symbol="n")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        fast = np.maximum(np.abs(s.v), _CREEP)  # below it linear, so that the slope at rest is finite
        v_0 = named("v_0", 0.01, s.v)
        return shown_as(
            -p["coefficient_N"] * s.v / v_0 * (fast / v_0) ** (p["exponent"] - 1),
            lambda: -p["coefficient_N"] * np.sign(s.v) * (np.abs(s.v) / v_0) ** p["exponent"],
        )


class InclineGravity(Effect):
    """Constant force along +x, `m g sin(alpha)` of a tilted lumen."""

    id = "incline_gravity"
    source = "tracing catalogue 13"
    kinds = frozenset({"magnetic", "coil", "vibro", "vibro_table", "pull"})
    probe = 0.002
    confounders = ("directional_asymmetry", "sensor_bias")

    force_N = number(0.0, "N", -0.5, 0.5, symbol="F_g")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["force_N"]


class StressRelaxation(Effect):
    """A Maxwell branch that slips: force `-k q`, `q' = v/(1 + b |v|) - q/tau - c |v| q`. It relaxes with time and with
    distance; c = 0 never slips; b > 0 thins as speed grows.
    """

    id = "stress_relaxation"
    source = "rat gut SLS, WJG 11:4974; five-element model (Kim)"
    symbols = by_name(stretch_m="q")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("wall",)
    states = ("stretch_m",)
    grid = by_name(time_s=(0.15, 0.4, 1.0, 3.0, 8.0))
    probe = 1.0
    confounders: ClassVar[tuple[str, ...]] = ("viscous_drag", "wall_viscosity", "stribeck")
    refined_by: ClassVar[tuple[str, ...]] = ("further_relaxation",)

    stiffness_N_per_m = number(0.0, "N/m", -30.0, 300.0, symbol="k")
    time_s = number(1.0, "s", 0.05, 20.0, symbol="tau")
    slip_per_m = number(0.0, "1/m", 0.0, 2000.0, "as a bristle's: LuGre, Canudas 1995", symbol="c")
    thinning_s_per_m = number(
        0.0, "s/m", 0.0, 5000.0, "shear thinning: Cross, J. Colloid Sci. 20 (1965) 417", symbol="b"
    )

    def force(self, s: Signals, p: Values, z: Values) -> Any:
        return -p["stiffness_N_per_m"] * z["stretch_m"]

    def advance(self, s: Signals, p: Values, z: Values, h: Any) -> dict[str, Any]:
        fading = 1 / p["time_s"] + np.abs(s.v) * p["slip_per_m"]
        decay = np.exp(-h * fading)
        drawn = s.v / (1 + np.abs(s.v) * p["thinning_s_per_m"])
        return {"stretch_m": z["stretch_m"] * decay + drawn / fading * (1 - decay)}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        drawn, slipped = s.v / (1 + p["thinning_s_per_m"] * np.abs(s.v)), p["slip_per_m"] * np.abs(s.v) * z["stretch_m"]
        return {
            "stretch_m": [
                equal(Formula(f"{cls.symbols['stretch_m']}'"), drawn - z["stretch_m"] / p["time_s"] - slipped)
            ]
        }


class FluidPlug(Effect):
    """Force `-c v max(q sgn(v), 0)`: liquid q, swept together ahead of the body, drags the more the faster it moves,
    `q' = v - |v| q/L`; the body leaves it behind when it turns round, and L is as far as the plug grows.
    """

    id = "fluid_plug"
    source = "Nonlinear Dyn. 2026, doi 10.1007/s11071-025-12175-z"
    symbols = by_name(swept_m="q")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("places",)
    states = ("swept_m",)
    grid = by_name(length_m=(0.01, 0.04, 0.15))
    probe = 10.0
    confounders = ("viscous_drag", "lumen_taper", "tissue_drying", "preconditioning", "stress_relaxation")

    drag_N_s_per_m2 = number(0.0, "N s/m^2", -100.0, 2000.0, symbol="c")
    length_m = number(0.04, "m", 0.003, 1.0, symbol="L")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["drag_N_s_per_m2"] * s.v * np.maximum(z["swept_m"] * np.sign(s.v), 0.0)

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        end = np.sign(s.v) * p["length_m"]
        return {"swept_m": end + (z["swept_m"] - end) * np.exp(-np.abs(s.v) * h / p["length_m"])}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"swept_m": [equal(Formula("q'"), s.v - np.abs(s.v) * z["swept_m"] / p["length_m"])]}


_PULSES = "contractions are pulses rather than sines"
# of neighbouring frequencies to screen: over half a minute their phases part by less than half a turn up to 0.4 Hz
RATIO = 1.09


def frequencies(lowest_Hz: float, highest_Hz: float) -> tuple[float, ...]:
    """Frequencies in Hz in steps of `RATIO` from `lowest_Hz` up to `highest_Hz`, the last one within both."""
    count = math.floor(math.log(highest_Hz / lowest_Hz) / math.log(RATIO) + 1e-9) + 1
    return tuple(lowest_Hz * RATIO**k for k in range(count))


def with_harmonics(wave: Value, turn: Value, p: Values, first: int, names: tuple[str, ...]) -> Value:
    """`wave` and harmonics of the angle `turn` in rad from order `first` on, sizes `NAME_sin` and `NAME_cos`."""
    for k, name in enumerate(names, start=first):
        wave = wave + p[f"{name}_sin"] * np.sin(k * turn) + p[f"{name}_cos"] * np.cos(k * turn)
    return wave


class ForceInTime(Effect):
    """Force `A (sin q + o + sum of b_k sin kq + c_k cos kq)` along +x, k from 2 to 4, `q = 2 pi (f t - n) + phi`, n the
    turns by which it is late at the capsule's position.

    A wave of pulses, `max(0, sin q)`, has A = 0.5, o = 0.64, c_2 = -0.42 and c_4 = -0.08.
    """

    probe = 0.003

    force_N = number(0.0, "N", -0.2, 0.2, "gut 35:625: 59 to 93 mN, twice that at most", symbol="A")
    frequency_Hz = number(0.25, "Hz", 0.03, 1.5, "tracing catalogue 15: 0.2 to 0.3 Hz", symbol="f")
    phase_rad = number(0.0, "rad", -7.0, 7.0, "any: where in its cycle a record begins", role="phase", symbol="phi")
    second_sin = number(0.0, "1", -1.0, 1.0, _PULSES, symbol="b_2")
    second_cos = number(0.0, "1", -1.0, 1.0, _PULSES, symbol="c_2")
    third_sin = number(0.0, "1", -0.7, 0.7, _PULSES, spread=0.2, symbol="b_3")
    third_cos = number(0.0, "1", -0.7, 0.7, _PULSES, spread=0.2, symbol="c_3")
    fourth_sin = number(0.0, "1", -0.5, 0.5, _PULSES, spread=0.2, symbol="b_4")
    fourth_cos = number(0.0, "1", -0.5, 0.5, _PULSES, spread=0.2, symbol="c_4")
    offset = number(0.0, "1", -1.5, 1.5, _PULSES, symbol="o")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return contraction(turn(s, p), p)


def turn(s: Signals, p: Values, late: Value = 0.0) -> Value:
    """The angle q in rad of a `ForceInTime` that is `late` by so many turns."""
    return named("q", 2 * math.pi * (p["frequency_Hz"] * s.t - late) + p["phase_rad"])


def contraction(turn: Value, p: Values) -> Value:
    """The force of a `ForceInTime` at its angle `turn` in rad."""
    return p["force_N"] * with_harmonics(np.sin(turn) + p["offset"], turn, p, 2, ("second", "third", "fourth"))


class Respiration(ForceInTime):
    """Force `A (sin q + o)` and harmonics of q along +x, `q = 2 pi f t + phi`."""

    id = "respiration"
    source = "tracing catalogue 15: 0.2 to 0.3 Hz"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time", "wall")
    grid = by_name(frequency_Hz=frequencies(0.04, 0.82))
    confounders = ("peristaltic_wave", "mains_hum")


_SPEED = "contractions that travel at 5 to 20 mm/s, 8.6 to 12.5 a minute"


class PeristalticWave(ForceInTime):
    """Force `A (sin q + o)` and harmonics of q along +x, `q = 2 pi (f t - k x) + phi`: it travels at `f/k`, along +x
    where both have one sign.

    The wave number passes smoothly through 0, where the wave is the same everywhere, to one that comes back; the speed
    would not. Below half of the longest wave's number, 8.6 a minute at 20 mm/s, it is a force in time.
    """

    id = "peristaltic_wave"
    source = "Kerlin and Phillips 1982: 8.6 to 12.5 a minute; gut 35:625: 59 to 93 mN"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time", "wall")
    grid = by_name(frequency_Hz=frequencies(0.04, 0.41), wavenumber_per_m=(6.0, 12.0, 19.0, 26.0, 34.0, 43.0))
    confounders = ("respiration", "fold_periodic")
    refined_by = ("wave_harmonics",)

    frequency_Hz = number(0.18, "Hz", 0.03, 0.6)
    wavenumber_per_m = number(18.0, "1/m", -80.0, 80.0, _SPEED, least=3.5, symbol="k")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return contraction(wave_turn(s, p), p)


def wave_turn(s: Signals, p: Values) -> Value:
    """The angle in rad of the wave at the capsule's position."""
    return turn(s, p, p["wavenumber_per_m"] * s.x)


class AddedMass(Effect):
    """Force `-m_a a`: fluid or rig mass that moves along."""

    id = "added_mass"
    source = "tracing catalogue 16"
    symbols = by_name(acceleration="v'")
    kinds = frozenset({"pull"})
    needs = ("speeds",)
    states = ("acceleration", "speed")
    probe = 0.01
    confounders = ("actuator_lag",)

    mass_kg = number(0.0, "kg", -0.005, 2.0, symbol="m_a")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["mass_kg"] * z["acceleration"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        return {"acceleration": (s.v - z["speed"]) / h, "speed": s.v}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        return {"acceleration": [], "speed": []}


class SpringOverPosition(Effect):
    """Force `-k x`; the spring's position of rest is part of the axis' constant force."""

    id = "spring_over_position"
    source = "Hooke's law; balancing springs, cables and hoses of machine axes"
    kinds = frozenset({"axis"})
    needs = ("places",)
    probe = 10.0
    confounders = ("gravity_over_angle", "lumen_taper")

    stiffness_N_per_m = number(0.0, "N/m", -1e5, 1e5, symbol="k")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["stiffness_N_per_m"] * s.x


class GravityOverAngle(Effect):
    """Torque `-G sin(x - x_0)`, `G = m g l`: 0 where the weight hangs (x_0), greatest a quarter turn from there."""

    id = "gravity_over_angle"
    source = "m g l of a lever: statics"
    kinds = frozenset({"axis"})
    needs = ("turning", "places")
    grid = by_name(hanging_rad=(0.0, 0.5 * math.pi))
    confounders = ("spring_over_position", "fold_periodic")

    torque_N_m = number(0.0, "N m", -1e3, 1e3, symbol="G")
    hanging_rad = number(0.0, "rad", -7.0, 7.0, role="phase", symbol="x_0")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["torque_N_m"] * np.sin(s.x - p["hanging_rad"])


class LoadForce(Effect):
    """Force `c N (1 + g (x - x_m))` of the logged load, pressure or temperature, whose lever or area may change along
    the way; x_m is its middle. Of several a sum, one `per_NAME` each.
    """

    id = "load_force"
    source = "statics: a load cell's lever, a piston's area"
    kinds = frozenset({"axis"})
    needs = ("logged",)
    exact = True
    confounders = ("load_dependent_friction", "spring_over_position", "directional_asymmetry")

    per_load = number(0.0, "N/(N or N m)", -1e9, 1e9, symbol="c")
    slope_per_m = number(0.0, "1/m", -100.0, 100.0, symbol="g")
    middle_m = number(0.0, "m", -10.0, 10.0, fit=False, symbol="x_m")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        total = sum(p[q.name] * s.logged(q.name[4:]) for q in self.parameters() if q.name.startswith("per_"))
        return total * (1 + p["slope_per_m"] * (s.x - p["middle_m"]))


class TorqueRipple(Effect):
    """Force `-(A sin q + b_2 sin 2q + c_2 cos 2q)`, `q = 2 pi x/L + phi`: the same both ways and at any speed."""

    id = "torque_ripple"
    source = "cogging and commutation of motors: Holtz, IEEE Trans. Ind. Electron. 43 (1996)"
    kinds = frozenset({"axis"})
    needs = ("places",)
    grid = by_name(wavelength_m=tuple(0.003 * 1.13**k for k in range(14)), phase_rad=(0.0, 1.5707963))
    confounders = ("gravity_over_angle", "fold_periodic", "spring_over_position")

    force_N = number(0.0, "N", -1e3, 1e3, symbol="A")
    wavelength_m = number(0.01, "m", 1e-4, 10.0, symbol="L")
    phase_rad = number(0.0, "rad", -7.0, 7.0, role="phase", symbol="phi")
    second_sin_N = number(0.0, "N", -1e3, 1e3, symbol="b_2")
    second_cos_N = number(0.0, "N", -1e3, 1e3, symbol="c_2")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        q = named("q", 2 * math.pi * s.x / p["wavelength_m"] + p["phase_rad"])
        second = p["second_sin_N"] * np.sin(2 * q) + p["second_cos_N"] * np.cos(2 * q)
        return -(p["force_N"] * np.sin(q) + second)


class ElasticDrive(Effect):
    """Force `-m (w^2 e + 2 zeta w e')` of a load m on a spring, `w = 2 pi f`; its stretch `e' = v - v_l` pulls the
    load, `v_l' = w^2 e + 2 zeta w e'`. Well below f it is added inertia.
    """

    id = "elastic_drive"
    source = "two-mass models of drives: Schroeder, Elektrische Antriebe"
    symbols = by_name(stretch_m="e", load_m_s="v_l")
    kinds = frozenset({"axis"})
    states = ("stretch_m", "load_m_s")
    behind = "stretch_m"
    needs = ("speeds",)
    grid = by_name(frequency_Hz=(2.0, 4.0, 8.0, 15.0, 25.0))
    confounders: ClassVar[tuple[str, ...]] = ("presliding", "sensor_delay")

    load_kg = number(0.0, "kg", 0.0, 1e4, symbol="m")
    frequency_Hz = number(8.0, "Hz", 0.5, 60.0, symbol="f")
    damping = number(0.05, "1", 0.0, 0.9, spread=0.3, symbol="zeta")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        w = named("w", 2 * math.pi * p["frequency_Hz"])
        return -p["load_kg"] * (w**2 * z["stretch_m"] + 2 * p["damping"] * w * (s.v - z["load_m_s"]))

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        after, rate = _swung(z["stretch_m"], s.v - z["load_m_s"], p, h)
        return {"stretch_m": after, "load_m_s": s.v - rate}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        w = named("w", 2 * math.pi * p["frequency_Hz"])
        rate = s.v - z["load_m_s"]
        pull = w**2 * z["stretch_m"] + 2 * p["damping"] * w * rate
        return {"stretch_m": [equal(Formula("e'"), rate)], "load_m_s": [equal(Formula("v_l'"), pull)]}


def _swung(e: Value, rate: Value, p: Values, h: Value) -> tuple[Value, Value]:
    """Stretch in m and its rate in m/s of an `ElasticDrive` after a time `h` in s at constant speed of the axis."""
    w, zeta = 2 * math.pi * p["frequency_Hz"], p["damping"]
    own, pulled = _own_swing(e, rate, p)
    decay, sine, cosine = np.exp(-zeta * w * h), np.sin(own * h), np.cos(own * h)
    return (
        decay * (e * cosine + pulled * sine),
        decay * (rate * cosine - (zeta * w * pulled + own * e) * sine),
    )


def _own_swing(e: Value, rate: Value, p: Values) -> tuple[Value, Value]:
    """Angular frequency in rad/s of the damped swing, and its sine's share in m, of a stretch `e` and its `rate`."""
    w, zeta = 2 * math.pi * p["frequency_Hz"], p["damping"]
    own = w * np.sqrt(1 - zeta**2)
    return own, (rate + zeta * w * e) / own


class DrivePlay(ElasticDrive):
    """An `elastic_drive` with play b: `-m (w^2 c + 2 zeta w e')` at the stretch e with `c = e - min(max(e, -b/2),
    b/2)`, nothing while |e| < b/2; the load rubs on the frame with m r. Within a step the moments at which an end of
    the play is met and left are exact, at most one of each; the load's friction acts in two halves around them.
    """

    id = "drive_play"
    source = "two-mass models with backlash: Nordin and Gutman, Automatica 38 (2002) 1633"
    kinds = frozenset({"driven_axis"})
    grid = by_name(frequency_Hz=(8.0, 25.0), play_m=(2e-4, 1e-3, 5e-3))
    confounders = ("elastic_drive", "presliding", "carriage_backlash")

    frequency_Hz = number(15.0, "Hz", 0.5, 120.0, symbol="f")
    damping = number(0.4, "1", 0.0, 0.9, spread=0.3, symbol="zeta")
    play_m = number(1e-3, "m", 0.0, 100.0, symbol="b")
    rubbing_m_s2 = number(0.1, "m/s^2", 0.0, 1e4, symbol="r")

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        w, e = named("w", 2 * math.pi * p["frequency_Hz"]), z["stretch_m"]
        c = e - np.clip(e, -0.5 * p["play_m"], 0.5 * p["play_m"])
        damped = 2 * p["damping"] * w * (s.v - z["load_m_s"])
        return -p["load_kg"] * np.where(np.abs(e) > 0.5 * p["play_m"], w**2 * c + damped, 0.0)

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        def rubbed(speed: Value) -> Value:
            return np.sign(speed) * np.maximum(np.abs(speed) - 0.5 * h * p["rubbing_m_s2"], 0.0)

        half, e, rate = 0.5 * p["play_m"], z["stretch_m"], s.v - rubbed(z["load_m_s"])
        moves = np.abs(rate) > _STILL
        across = np.where(moves, np.clip((np.sign(rate) * half - e) / np.where(moves, rate, 1.0), 0.0, h), h)
        loose = np.where(np.abs(e) < half, across, 0.0)
        end = np.clip(e + rate * loose, -half, half)
        c, left = e + rate * loose - end, h - loose
        side = np.where(c == 0, np.sign(rate), np.sign(c))
        own, pulled = _own_swing(c, rate, p)
        held = np.minimum((np.arctan2(side * pulled, np.abs(c)) + 0.5 * math.pi) / own, left)
        c, rate = _swung(c, rate, p, held)
        after = np.where(held < left, np.clip(end + rate * (left - held), -half, half), end + c)
        return {"stretch_m": after, "load_m_s": rubbed(s.v - rate)}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        w, e, half = named("w", 2 * math.pi * p["frequency_Hz"]), z["stretch_m"], p["play_m"] / 2
        rate, c = s.v - z["load_m_s"], named("c", e - np.clip(e, -half, half))
        pull = np.where(np.abs(e) > half, w**2 * c + 2 * p["damping"] * w * rate, 0.0)
        return {
            "force": [equal(Formula("F_extra"), -p["load_kg"] * pull)],
            "stretch_m": [equal(Formula("e'"), rate)],
            "load_m_s": [equal(Formula("v_l'"), pull - p["rubbing_m_s2"] * np.sign(z["load_m_s"]))],
        }
