"""Finer shapes of effects that are already named; a search never names one of these by itself."""

import itertools

import numpy as np

from models.effects.drive import ActuatorLag
from models.effects.effect import Effect, InnerMassEffect, Shares, Signals, Value, Values, by_name, number
from models.effects.force import PeristalticWave, StressRelaxation, wave_turn, with_harmonics
from models.effects.friction import TissueDrying, settling_time
from models.effects.sensor import SensorLowpass
from models.effects.wall import WallViscosity
from models.formula import at_least, interpolated, named, polynomial, shown_as
from models.parameter import Parameter

_WEIGHT = "paper V Eq. 11: of the normal load only what the wall presses follows the hoop stress, not the weight"
_SIDES = (
    "paper V Eq. 8 and 11: F_e is the wall's resistance at the nose, f_c what it takes to slip along the whole capsule"
)


class LevelAtOnset(Effect):
    """Where effects change resistance to `l` times what it was, `F_e (1 + (1 - max(-q, 0))(l - 1))` and the slip limit
    `f_c = mu (m g (1 + (1 - k)(l - 1)) + N_p (1 + (1 - max(q, 0))(l - 1)))`, N_p what the wall presses: k is the share
    of the weight's friction that stays as it is. q = 0: all but that follows; q = 1: F_e alone and not N_p; q = -1: the
    slip limit alone and not F_e. Both may go half beyond, for a search on a base that is still wrong takes that way.
    """

    id = "level_at_onset"
    words = "separate friction scales of nose and slip limit"
    summary = "a nose or a slip limit that a changed resistance leaves as it is"
    source = _SIDES
    symbols = by_name(kept="k", spared="q")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    grid = by_name(kept=(1.0,), spared=(0.0, 1.0, -1.0))
    probe = 0.1
    confounders = ("level_over_speed",)
    separated_by = "runs at one speed over places, times or directions that differ"

    kept = number(0.0, "1", -0.5, 1.5, _WEIGHT, spread=1.0)
    spared = number(0.0, "1", -1.5, 1.5, _SIDES, spread=1.0)

    def shared(self, p: Values, factors: Shares) -> Shares:
        nose, weight, pressed = factors
        q = p["spared"]
        return _less(nose, np.maximum(-q, 0.0)), _less(weight, p["kept"]), _less(pressed, np.maximum(q, 0.0))


def _less(level: Value, share: Value) -> Value:
    return level - share * (level - 1)


class LevelAtCreep(Effect):
    """Level `1 + (e + d o) exp(-|v|/v_c)`, d the (last) direction: a law's changed level comes with the speed."""

    id = "level_at_creep"
    words = "a different friction at creep"
    summary = "resistance in creep and at rest that differs from the one in motion"
    source = "no law: friction of a body that creeps or rests need not be what it was in the last motion"
    symbols = by_name(odd="o", even="e", speed_m_s="v_c")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    by_speed = True
    probe = 0.02
    confounders = ("stribeck", "dwell_adhesion")
    separated_by = "rests after motions in both directions"

    odd = number(0.0, "1", -0.9, 0.9, spread=0.3)
    even = number(0.0, "1", -0.9, 0.9, spread=0.3)
    speed_m_s = number(2e-4, "m/s", 1e-6, 2e-3)

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        creep = np.exp(-np.abs(s.v) / p["speed_m_s"])
        return at_least(1 + (p["even"] + p["odd"] * s.direction) * creep, 0.05)


KNOTS_M_S = (0.0, 0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, 0.016)  # of the curve, each about twice the one before


def _knot() -> Parameter:
    return number(0.0, "1", -0.5, 0.5, spread=0.003)


class LevelOverSpeed(Effect):
    """Level `1 + e(|v|) + d o(|v|)`, d the direction of motion (at rest the last one): both curves straight between
    knots at 0, 0.2, 0.5, 1, 2, 4, 8 and 16 mm/s, constant beyond. `even_k` and `odd_k` are their values at the
    knots.
    """

    id = "level_over_speed"
    words = "a free curve of friction over speed"
    summary = "resistance as a free curve over speed"
    source = "no law: a curve through the speeds that the records contain"
    symbols = by_name(**{f"{side}_{k}": f"{side[0]}_{k}" for side in ("even", "odd") for k in range(1, 9)})
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    by_speed = True
    probe = 0.02
    confounders = ("stribeck", "viscous_drag", "directional_asymmetry")
    separated_by = "speeds over two decades"

    even_1, even_2, even_3, even_4, even_5, even_6, even_7, even_8 = (_knot() for _ in range(8))
    odd_1, odd_2, odd_3, odd_4, odd_5, odd_6, odd_7, odd_8 = (_knot() for _ in range(8))

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        even, odd = p["even_1"], p["odd_1"]
        for k, (low, high) in enumerate(itertools.pairwise(KNOTS_M_S), start=1):
            share = np.clip((np.abs(s.v) - low) / (high - low), 0.0, 1.0)
            even = even + (p[f"even_{k + 1}"] - p[f"even_{k}"]) * share
            odd = odd + (p[f"odd_{k + 1}"] - p[f"odd_{k}"]) * share
        even = named("e", shown_as(even, lambda: _knots(np.abs(s.v), p, "even")))
        odd = named("o", shown_as(odd, lambda: _knots(np.abs(s.v), p, "odd")))
        return at_least(1 + even + odd * s.direction, 0.05)


def _knots(speed: Value, p: Values, side: str) -> Value:
    return interpolated(speed, KNOTS_M_S, [p[f"{side}_{k}"] for k in range(1, len(KNOTS_M_S) + 1)])


_MINUTE_S = 60.0  # time after which both shapes are the same


class DryingShape(Effect):
    """Level `1 + d u^3 + e u^4 + f u^5`, `u = s/s(60 s)` the drying's own time over a minute's; never below 0.05."""

    id = "drying_shape"
    words = "a free curve of the drying"
    summary = "the finer shape of a drift of the resistance"
    source = "no law: a drift settles as it likes"
    symbols = by_name(third="d_3", fourth="d_4", fifth="d_5", settling_s="t_s")
    kinds = TissueDrying.kinds
    of = TissueDrying.id
    probe = 0.01
    confounders = (TissueDrying.id,)
    separated_by = "longer records"

    third, fourth, fifth = (number(0.0, "1", -1.0, 1.0, spread=0.1) for _ in range(3))

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        u = named("u", settling_time(s.t, p) / settling_time(_MINUTE_S, p))
        return at_least(1 + polynomial(u, p["third"], p["fourth"], p["fifth"]) * u**3, 0.05)


_ORDERS = {5: "fifth", 6: "sixth", 7: "seventh", 8: "eighth"}


def _harmonic() -> Parameter:
    return number(0.0, "1", -0.3, 0.3, spread=0.05)


class WaveHarmonics(Effect):
    """Force `A (sum of harmonics 5 to 8 of q)` along +x, with A and q of the peristaltic wave."""

    id = "wave_harmonics"
    words = "higher harmonics of the wave"
    summary = "the fifth to eighth harmonics of a wave"
    source = "no law: contractions that begin and end sharply have harmonics that fall with the square of their order"
    symbols = by_name(
        **PeristalticWave.symbols,
        **{f"{name}_sin": f"b_{k}" for k, name in _ORDERS.items()},
        **{f"{name}_cos": f"c_{k}" for k, name in _ORDERS.items()},
    )
    kinds = PeristalticWave.kinds
    of = PeristalticWave.id
    probe = 0.02
    confounders = ("peristaltic_wave",)
    separated_by = "many contractions at one place"

    fifth_sin, fifth_cos, sixth_sin, sixth_cos = (_harmonic() for _ in range(4))
    seventh_sin, seventh_cos, eighth_sin, eighth_cos = (_harmonic() for _ in range(4))

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return p["force_N"] * with_harmonics(0.0, wave_turn(s, p), p, 5, tuple(_ORDERS.values()))


class FurtherRelaxation(StressRelaxation):
    """A second branch that slips, `-k_2 q_2`, `q_2' = v - q_2/tau_2 - c_2 |v| q_2`."""

    id = "further_relaxation"
    symbols = by_name(
        stiffness_N_per_m="k_2", time_s="tau_2", slip_per_m="c_2", thinning_s_per_m="b_2", stretch_m="q_2"
    )
    words = "a second relaxation time"
    summary = "a second relaxation time"
    source = "generalised Maxwell model: soft tissue relaxes with more than one time (Fung, Biomechanics, ch. 7)"
    grid = by_name(time_s=(0.3,))
    confounders = (StressRelaxation.id,)
    separated_by = "stops of very different length"
    refined_by = ()

    stiffness_N_per_m = number(0.0, "N/m", -100.0, 300.0)
    time_s = number(0.3, "s", 0.02, 20.0)
    slip_per_m = number(100.0, "1/m", 0.0, 2000.0)
    thinning_s_per_m = number(0.0, "s/m", 0.0, 5000.0, fit=False)


class FurtherLag(ActuatorLag):
    """`tau_2 c'' = c' - c''` of the command `c'` that the first lag lets through."""

    id = "further_lag"
    symbols = by_name(time_s="tau_2", command="u")
    words = "a second lag of the drive"
    summary = "a second lag of the drive"
    source = "a current loop under a position loop: drives are of second order or more"
    grid = by_name(time_s=(0.03,))
    confounders = ("actuator_lag", "sensor_delay")
    refined_by = ()

    time_s = number(0.0, "s", 0.0, 0.5)


class FurtherLowpass(SensorLowpass):
    """`tau_2 y'' + y' = x'` of the reading `x'` that the first low-pass lets through."""

    id = "further_lowpass"
    symbols = by_name(time_s="tau_2", smooth="y")
    words = "a second low-pass of the sensor"
    summary = "a second smoothing of the measurement"
    source = "an amplifier's filter before a digital one: smoothing is of second order or more"
    confounders = ("sensor_lowpass", "sensor_delay")
    refined_by = ()

    time_s = number(0.0, "s", 0.0, 0.3)


class ViscosityThinning(Effect):
    """Wall force `c u' ((1 + (u'/u_0')^2)^(n/2) - 1)` beyond `c u'`: together Carreau's law, one plateau."""

    id = "viscosity_thinning"
    words = "a shear-thinning wall"
    summary = "a viscous wall that thins with its rate"
    source = "Carreau's law of a viscosity that changes with the rate, Trans. Soc. Rheol. 16 (1972) 99"
    symbols = by_name(viscosity_N_s_per_m="c", power="n", rate_m_s="w_0")
    kinds = WallViscosity.kinds
    of = WallViscosity.id
    grid = by_name(power=(0.0,), rate_m_s=(2e-3,))
    probe = 0.1
    confounders = (WallViscosity.id,)
    separated_by = "speeds over two decades"

    power = number(0.0, "1", -0.9, 0.5, spread=0.3)
    rate_m_s = number(2e-3, "m/s", 1e-4, 2e-2)

    def wall_force(self, s: Signals, p: Values, z: Values) -> Value:
        ratio = named("r", s.drag_rate / p["rate_m_s"])
        return p["viscosity_N_s_per_m"] * s.drag_rate * ((1 + ratio * ratio) ** (p["power"] / 2) - 1)


DAMPING_KNOTS_M_S = (0.0, 0.1, 0.2, 0.4, 0.8)  # of the curve, over the inner mass's speed


class DampingOverSpeed(InnerMassEffect):
    """Force `c(|xi'|) xi'`: c is 0 at rest, straight between knots at 0.1, 0.2, 0.4 and 0.8 m/s, constant beyond; `c_k`
    are its values there. Refines an effect, never named itself.
    """

    id = "damping_over_speed"
    words = "a free curve of damping over speed"
    summary = "damping of the suspension as a free curve over speed"
    source = "no law: a curve through the speeds that the records contain"
    kinds = frozenset({"vibro"})
    probe = 0.05
    confounders = ("spring_damping", "guide_friction")
    separated_by = "ring-down of the inner mass from several amplitudes"

    c_1, c_2, c_3, c_4 = (number(0.0, "N s/m", -2.0, 2.0, spread=0.2) for _ in range(4))

    def suspension(self, stretch: Value, rate: Value, p: Values) -> Value:
        damping, below = 0.0, 0.0
        for k, (low, high) in enumerate(itertools.pairwise(DAMPING_KNOTS_M_S), start=1):
            damping = damping + (p[f"c_{k}"] - below) * np.clip((np.abs(rate) - low) / (high - low), 0.0, 1.0)
            below = p[f"c_{k}"]
        values = [0.0, *(p[f"c_{k}"] for k in range(1, len(DAMPING_KNOTS_M_S)))]
        damping = named("c", shown_as(damping, lambda: interpolated(np.abs(rate), DAMPING_KNOTS_M_S, values)))
        return damping * rate
