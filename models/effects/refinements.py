"""Finer shapes of effects that are already named; a search never names one of these by itself."""

import numpy as np

from models.effects.drive import ActuatorLag
from models.effects.effect import Effect, InnerMassEffect, Shares, Signals, Value, Values, by_name, number
from models.effects.force import PeristalticWave, StressRelaxation, wave_turn, with_harmonics
from models.effects.friction import TissueDrying, settling_time
from models.effects.sensor import SensorLowpass
from models.effects.shapes import knots
from models.effects.wall import WallViscosity
from models.formula import at_least, named, polynomial
from models.parameter import Parameter

_WEIGHT = "paper V Eq. 11: of the normal load only what the wall presses follows the hoop stress, not the weight"
_SIDES = (
    "paper V Eq. 8 and 11: F_e is the wall's resistance at the nose, f_c what it takes to slip along the whole capsule"
)


class LevelAtOnset(Effect):
    """Effects change friction to lambda times the base's. With it F_e is `1 + (1 - max(-q, 0)) (lambda - 1)` times the
    base's, and the slip limit `f_c = mu (m g (1 + (1 - k) (lambda - 1)) + N_p (1 + (1 - max(q, 0)) (lambda - 1)))`, N_p
    the wall's pressure.

    k is the share of the weight's friction that stays. q = 0: all else follows; q = 1: F_e alone; q = -1: the slip
    limit alone. Both may go half beyond, which a search from a wrong base needs.
    """

    id = "level_at_onset"
    source = _SIDES
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = by_name(kept=(1.0,), spared=(0.0, 1.0, -1.0))
    confounders = ("level_over_speed",)

    kept = number(0.0, "1", -0.5, 1.5, _WEIGHT, spread=1.0, symbol="k")
    spared = number(0.0, "1", -1.5, 1.5, _SIDES, spread=1.0, symbol="q")

    def shared(self, p: Values, factors: Shares) -> Shares:
        nose, weight, pressed = factors
        q = p["spared"]
        return _less(nose, np.maximum(-q, 0.0)), _less(weight, p["kept"]), _less(pressed, np.maximum(q, 0.0))


def _less(level: Value, share: Value) -> Value:
    return level - share * (level - 1)


class LevelOnViscous(Effect):
    """Effects change friction to lambda times the base's. With it the viscous friction of an axis is
    `1 + (1 - k) (lambda - 1)` times the base's. k = 0: all of it follows; k = 1: dry friction alone, as under a load.
    """

    id = "level_on_viscous"
    source = "Coulomb: dry friction follows the load; a film's drag follows its viscosity"
    kinds = frozenset({"axis"})
    grid = by_name(kept=(1.0,))

    kept = number(0.0, "1", -0.5, 1.5, spread=1.0, symbol="k_v")

    def shared(self, p: Values, factors: Shares) -> Shares:
        dry, viscous, rest = factors
        return dry, _less(viscous, p["kept"]), rest


class LevelAtCreep(Effect):
    """Scale `1 + (e + o sgn(v)) exp(-|v|/v_c)`, at rest with the last direction: in motion it comes with the speed."""

    id = "level_at_creep"
    source = "no law: friction of a body that creeps or rests need not be what it was in the last motion"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    by_speed = True
    probe = 0.02
    confounders = ("stribeck", "dwell_adhesion")

    odd = number(0.0, "1", -0.9, 0.9, spread=0.3, symbol="o")
    even = number(0.0, "1", -0.9, 0.9, spread=0.3, symbol="e")
    speed_m_s = number(2e-4, "m/s", 1e-6, 2e-3, symbol="v_c")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        creep = np.exp(-np.abs(s.v) / p["speed_m_s"])
        return at_least(1 + (p["even"] + p["odd"] * s.direction) * creep, 0.05)


KNOTS_M_S = (0.0, 0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)  # of the curve, each about twice the one before


def _knots_of(letter: str) -> list[Parameter]:
    return [number(0.0, "1", -0.5, 0.5, spread=0.003, symbol=f"{letter}_{k}") for k in range(1, len(KNOTS_M_S) + 1)]


class LevelOverSpeed(Effect):
    """Scale `1 + e(|v|) + o(|v|) sgn(v)`, at rest with the last direction. Both curves are straight between knots at 0,
    0.2, 0.5, 1, 2, 4, 8 and 16 mm/s and constant beyond; `e_k` and `o_k` are their values there.
    """

    id = "level_over_speed"
    source = "no law: a curve through the speeds that the records contain"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    by_speed = True
    probe = 0.02
    confounders = ("stribeck", "viscous_drag", "directional_asymmetry")

    even_1, even_2, even_3, even_4, even_5, even_6, even_7, even_8 = _knots_of("e")
    odd_1, odd_2, odd_3, odd_4, odd_5, odd_6, odd_7, odd_8 = _knots_of("o")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        even, odd = ([p[f"{side}_{k}"] for k in range(1, len(KNOTS_M_S) + 1)] for side in ("even", "odd"))
        e, o = (named(name, knots(np.abs(s.v), KNOTS_M_S, values)) for name, values in (("e", even), ("o", odd)))
        return at_least(1 + e + o * s.direction, 0.05)


_MINUTE_S = 60.0  # time after which both shapes are the same


class DryingShape(Effect):
    """Scale `1 + d_3 u^3 + d_4 u^4 + d_5 u^5`, `u = t_e(t)/t_e(60 s)` of the drying's own time; never below 0.05."""

    id = "drying_shape"
    source = "no law: a drift settles in its own way"
    symbols = by_name(**TissueDrying.letters())
    kinds = TissueDrying.kinds
    of = TissueDrying.id
    probe = 0.01
    confounders = (TissueDrying.id,)

    third, fourth, fifth = (number(0.0, "1", -1.0, 1.0, spread=0.1, symbol=f"d_{k}") for k in (3, 4, 5))

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        u = named("u", settling_time(s.t, p) / settling_time(_MINUTE_S, p))
        return at_least(1 + polynomial(u, p["third"], p["fourth"], p["fifth"]) * u**3, 0.05)


_ORDERS = {5: "fifth", 6: "sixth", 7: "seventh", 8: "eighth"}


class WaveHarmonics(Effect):
    """Force `A (sum of b_k sin kq + c_k cos kq)` along +x, k from 5 to 8, with A and q of the peristaltic wave."""

    id = "wave_harmonics"
    source = "no law: contractions that begin and end sharply have harmonics that fall with the square of their order"
    symbols = by_name(**PeristalticWave.letters())
    kinds = PeristalticWave.kinds
    of = PeristalticWave.id
    probe = 0.02
    confounders = ("peristaltic_wave",)

    fifth_sin, fifth_cos, sixth_sin, sixth_cos, seventh_sin, seventh_cos, eighth_sin, eighth_cos = (
        number(0.0, "1", -0.3, 0.3, spread=0.05, symbol=f"{letter}_{k}") for k in _ORDERS for letter in "bc"
    )

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["force_N"] * with_harmonics(0.0, wave_turn(s, p), p, 5, tuple(_ORDERS.values()))


class FurtherRelaxation(StressRelaxation):
    """A second branch that slips: force `-k_2 q_2`, `q_2' = v - q_2/tau_2 - c_2 |v| q_2`."""

    id = "further_relaxation"
    symbols = by_name(stretch_m="q_2")
    source = "generalised Maxwell model: soft tissue relaxes with more than one time (Fung, Biomechanics, ch. 7)"
    grid = by_name(time_s=(0.3,))
    confounders = (StressRelaxation.id,)
    refined_by = ()

    stiffness_N_per_m = number(0.0, "N/m", -100.0, 300.0, symbol="k_2")
    time_s = number(0.3, "s", 0.02, 20.0, symbol="tau_2")
    slip_per_m = number(100.0, "1/m", 0.0, 2000.0, symbol="c_2")
    thinning_s_per_m = number(0.0, "s/m", 0.0, 5000.0, fit=False, symbol="b_2")


class FurtherLag(ActuatorLag):
    """Lag `tau_2 u' = u_cmd - u` of what the first lag lets through."""

    id = "further_lag"
    source = "a current loop under a position loop: drives are of second order or more"
    grid = by_name(time_s=(0.03,))
    confounders = ("actuator_lag", "sensor_delay")
    refined_by = ()

    time_s = number(0.0, "s", 0.0, 0.5, symbol="tau_2")


class FurtherLowpass(SensorLowpass):
    """Reading `tau_2 y' = y_0 - y` of what the first low-pass lets through."""

    id = "further_lowpass"
    source = "an amplifier's filter before a digital one: smoothing is of second order or more"
    confounders = ("sensor_lowpass", "sensor_delay")
    refined_by = ()

    time_s = number(0.0, "s", 0.0, 0.3, symbol="tau_2")


class ViscosityThinning(Effect):
    """Wall force `c u_w' ((1 + (u_w'/w_0)^2)^(n/2) - 1)` beside `c u_w'`: together Carreau's law with one plateau."""

    id = "viscosity_thinning"
    source = "Carreau's law of a viscosity that changes with the rate, Trans. Soc. Rheol. 16 (1972) 99"
    symbols = by_name(viscosity_N_s_per_m="c")
    kinds = WallViscosity.kinds
    of = WallViscosity.id
    grid = by_name(power=(0.0,), rate_m_s=(2e-3,))
    confounders = (WallViscosity.id,)

    power = number(0.0, "1", -0.9, 0.5, spread=0.3, symbol="n")
    rate_m_s = number(2e-3, "m/s", 1e-4, 2e-2, symbol="w_0")

    def wall_force(self, s: Signals, p: Values, z: Values) -> Value:
        ratio = named("r", s.drag_rate / p["rate_m_s"])
        return p["viscosity_N_s_per_m"] * s.drag_rate * ((1 + ratio * ratio) ** (p["power"] / 2) - 1)


DAMPING_KNOTS_M_S = (0.0, 0.1, 0.2, 0.4, 0.8)  # of the curve, over the inner mass's speed


class DampingOverSpeed(InnerMassEffect):
    """Force `c(|xi'|) xi'`: c is 0 at rest, straight between knots at 0.1, 0.2, 0.4 and 0.8 m/s and constant beyond;
    `c_k` are its values there.
    """

    id = "damping_over_speed"
    source = "no law: a curve through the speeds that the records contain"
    kinds = frozenset({"vibro"})
    probe = 0.05
    confounders = ("spring_damping", "guide_friction")

    c_1, c_2, c_3, c_4 = (number(0.0, "N s/m", -2.0, 2.0, spread=0.2) for _ in range(4))

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        values = [0.0, *(p[f"c_{k}"] for k in range(1, len(DAMPING_KNOTS_M_S)))]
        damping = named("c", knots(np.abs(rate), DAMPING_KNOTS_M_S, values))
        return damping * rate
