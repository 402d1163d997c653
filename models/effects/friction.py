"""Effects that scale the friction along the lumen, or the load that presses the capsule on its surface."""

import math

import numpy as np

from models.effects.effect import Effect, Forms, Signals, Value, Values, by_name, number
from models.formula import Formula, at_least, equal, named, polynomial, shown_as

_SETTLES = "drifts of a bench settle within minutes"


class DriftInTime(Effect):
    """Factor `1 + b t_e + c t_e^2` of a time `t_e = t/(1 + t/t_s)` that settles; never below 0.05."""

    probe = 0.001

    rate_per_s = number(0.0, "1/s", -0.08, 0.08, _SETTLES, symbol="b")
    bend_per_s2 = number(0.0, "1/s^2", -3e-3, 3e-3, _SETTLES, symbol="c")
    settling_s = number(100.0, "s", 10.0, 1000.0, _SETTLES, spread=100.0, symbol="t_s")


def drift(t: Value, p: Values) -> Value:
    """The factor of a `DriftInTime` at the time `t` in s since the record began."""
    s = named("t_e", settling_time(t, p))
    return at_least(polynomial(s, 1, p["rate_per_s"], p["bend_per_s2"]), 0.05)


def settling_time(t: Value, p: Values) -> Value:
    """The time s in s that runs slower and slower, up to `settling_s`."""
    return t / (1 + t / p["settling_s"])


_REST_M_S = 1e-9  # m/s, keeps the power's derivative finite


class Stribeck(Effect):
    """Scale `1 + a exp(-(|v|/v_s)^delta)`: an excess below the speed v_s, without memory. delta is 2 classically, 1/2
    to 2 where it was measured.
    """

    id = "stribeck"
    source = "Stribeck curve; Monatsh. Chem. 2016 for mucus"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "friction"})
    needs = ("speeds",)
    grid = by_name(speed_m_s=(0.001, 0.003, 0.01))
    by_speed = True
    confounders = ("dwell_adhesion", "viscous_drag")
    refined_by = ("level_at_onset", "level_on_viscous", "level_at_creep", "level_over_speed")

    excess = number(0.0, "1", -0.8, 3.0, symbol="a")
    speed_m_s = number(0.003, "m/s", 0.0002, 0.05, symbol="v_s")
    exponent = number(2.0, "1", 0.5, 4.0, "Armstrong-Helouvry 1991: 1/2 to 2", spread=1.0, symbol="delta")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["excess"] * np.exp(-((at_least(np.abs(s.v), _REST_M_S) / p["speed_m_s"]) ** p["exponent"]))


class DirectionalAsymmetry(Effect):
    """Scale `1 + a sgn(v)`: constant while sliding, of either sign."""

    id = "directional_asymmetry"
    source = "tracing catalogue 14; EMPS, Janot et al. 2019"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "friction"})
    needs = ("both_ways",)
    probe = 0.05
    confounders = ("incline_gravity", "sensor_bias")
    refined_by = ("level_at_onset", "level_on_viscous", "level_at_creep", "level_over_speed")

    asymmetry = number(0.0, "1", -0.9, 0.9, symbol="a")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["asymmetry"] * s.direction


class FoldPeriodic(Effect):
    """Scale `1 + a (sin q + b_2 sin 2q + c_2 cos 2q + b_3 sin 3q + c_3 cos 3q)`, `q = 2 pi x/L + phi`, both ways."""

    id = "fold_periodic"
    source = "folds up to 8 mm deep (Gray)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    needs = ("places",)
    grid = by_name(wavelength_m=tuple(0.003 * 1.13**k for k in range(14)), phase_rad=(0.0, 1.5707963))
    probe = 0.05
    confounders = ("lumen_taper", "peristaltic_wave")
    refined_by = ("level_at_onset", "level_on_viscous")

    depth = number(0.0, "1", -0.9, 0.9, symbol="a")
    wavelength_m = number(0.008, "m", 0.002, 0.016, symbol="L")
    phase_rad = number(0.0, "rad", -7.0, 7.0, role="phase", symbol="phi")
    second_sin = number(0.0, "1", -1.0, 1.0, symbol="b_2")
    second_cos = number(0.0, "1", -1.0, 1.0, symbol="c_2")
    third_sin = number(0.0, "1", -0.7, 0.7, symbol="b_3")
    third_cos = number(0.0, "1", -0.7, 0.7, symbol="c_3")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        turn = named("q", 2 * math.pi * s.x / p["wavelength_m"] + p["phase_rad"])
        wave = np.sin(turn) + p["second_sin"] * np.sin(2 * turn) + p["second_cos"] * np.cos(2 * turn)
        wave = wave + p["third_sin"] * np.sin(3 * turn) + p["third_cos"] * np.cos(3 * turn)
        return at_least(1 + p["depth"] * wave, 0.05)


class LumenTaper(Effect):
    """Scale `1 + g y + b y^2 + c y^3`, `y = r/sqrt(1 + (r/L)^2)`, `r = x - x_m`: a lumen that narrows, or a capstan's
    bend. The change itself changes with position and fades beyond the reach L of its middle x_m.
    """

    id = "lumen_taper"
    source = "tracing catalogue 11, 12"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro", "axis"})
    needs = ("places",)
    grid = by_name(reach_m=(0.02, 0.2))
    probe = 2.0
    confounders = ("tissue_drying", "stenosis")
    refined_by = ("level_at_onset", "level_on_viscous")

    slope_per_m = number(0.0, "1/m", -30.0, 30.0, symbol="g")
    bend_per_m2 = number(0.0, "1/m^2", -600.0, 600.0, symbol="b")
    curl_per_m3 = number(0.0, "1/m^3", -2e4, 2e4, symbol="c")
    reach_m = number(0.05, "m", 0.01, 1.0, symbol="L")
    middle_m = number(0.0, "m", -0.3, 0.3, spread=0.05, symbol="x_m")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        r = named("r", s.x - p["middle_m"])
        y = named("y", r / np.sqrt(1 + (r / p["reach_m"]) ** 2))
        return at_least(polynomial(y, 1, p["slope_per_m"], p["bend_per_m2"], p["curl_per_m3"]), 0.05)


_END = 1e-9 - 1  # of a bump that ends, where its logarithm would


class Stenosis(Effect):
    """Scale `1 + a (1 + m (m + 1) q^2/2)^(-1/m)`, `q = r/(w (1 + k sgn(r)))`, `r = x - x_0`.

    The skew k makes one flank steeper. The tail m leads from a bump that ends, `(1 - q^2/8)^2` at m = -1/2, over a
    Gaussian at 0 to a Lorentzian, `1/(1 + q^2)`, at 1.
    """

    id = "stenosis"
    source = "tracing catalogue 11"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("places",)
    grid = by_name(width_m=(0.0015, 0.004))
    probe = 0.2
    confounders = ("lumen_taper", "fold_periodic")
    refined_by = ("level_at_onset",)

    excess = number(0.0, "1", -0.9, 6.0, symbol="a")
    centre_m = number(0.0, "m", -0.3, 0.3, role="place", symbol="x_0")
    width_m = number(0.003, "m", 0.0005, 0.012, symbol="w")
    tail = number(1.0, "1", -0.6, 2.0, symbol="m")
    skew = number(0.0, "1", -0.6, 0.6, symbol="k")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        away = named("r", s.x - p["centre_m"])
        apart = named("q", away / (p["width_m"] * (1 + p["skew"] * np.sign(away))))
        m = p["tail"]
        bump = np.maximum(0.5 * m * (1 + m) * apart * apart, _END)
        bell = shown_as(np.exp(-np.log1p(bump) / m), lambda: (1 + m * (m + 1) * apart**2 / 2) ** (-1 / m))
        return 1 + p["excess"] * bell


class DwellAdhesion(Effect):
    """Scale `1 + b theta`: at rest theta grows as `1 - exp(-t/t_a)`, in motion it fades over the slip length L."""

    id = "dwell_adhesion"
    source = "rate and state ageing, Dillavou arXiv:1908.02676"
    symbols = by_name(age="theta")
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("rests",)
    states = ("age",)
    grid = by_name(ageing_time_s=(0.5, 3.0), slip_length_m=(0.0003, 0.002))
    confounders = ("stribeck", "stress_relaxation")
    refined_by = ("level_at_onset",)

    peak = number(0.0, "1", -0.5, 3.0, symbol="b")
    ageing_time_s = number(2.0, "s", 0.1, 60.0, symbol="t_a")
    slip_length_m = number(0.0005, "m", 5e-05, 0.01, symbol="L")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 + p["peak"] * z["age"]

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        rest = np.where(np.abs(s.v) < 1e-6, 1.0, 0.0)
        aged = 1 - (1 - z["age"]) * np.exp(-h / p["ageing_time_s"])
        return {"age": np.where(rest == 1, aged, z["age"] * np.exp(-np.abs(s.v) * h / p["slip_length_m"]))}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        ageing, fading = (1 - z["age"]) / p["ageing_time_s"], -np.abs(s.v) * z["age"] / p["slip_length_m"]
        return {"age": [equal(Formula("theta'"), np.where(s.v == 0, ageing, fading))]}


class Preconditioning(Effect):
    """Scale `1 - a (1 - (1 - q) exp(-s/L) - q exp(-5 s/L))` over the path s: a share q of the fall comes in the first
    fifth of the length L, as the first of Terry's cycles took more than the later ones.
    """

    id = "preconditioning"
    source = "Terry 2014: 13 cycles; Mullins"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("places",)
    grid = by_name(length_m=(0.03, 0.1))
    probe = 0.05
    confounders = ("tissue_drying",)
    refined_by = ("level_at_onset",)

    fall = number(0.0, "1", -1.0, 0.9, symbol="a")
    length_m = number(0.05, "m", 0.01, 0.5, symbol="L")
    quick = number(0.0, "1", 0.0, 0.9, "Terry 2014: the first cycle takes most", spread=0.3, symbol="q")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        path = s.travelled / p["length_m"]
        return 1 - p["fall"] * (1 - (1 - p["quick"]) * np.exp(-path) - p["quick"] * np.exp(-5 * path))


class TissueDrying(DriftInTime):
    """Scale `1 + b t_e + c t_e^2` of a clock time that settles, also at rest."""

    id = "tissue_drying"
    source = "paper C Section 2.2 (drying in air)"
    kinds = frozenset({"pull", "magnetic", "coil", "vibro"})
    needs = ("time",)
    confounders = ("preconditioning", "coupling_fade", "lumen_taper")
    refined_by = ("level_at_onset", "drying_shape")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return drift(s.t, p)


class LoadDependentFriction(Effect):
    """Scale `1 + c |N|` of the logged load, in whichever unit; of several a sum, one `growth_per_NAME` each."""

    id = "load_dependent_friction"
    source = "load-dependent friction of robot joints: Hamon et al. 2010; Bittencourt and Gunnarsson 2012"
    kinds = frozenset({"axis", "friction"})
    needs = ("load",)
    confounders = ("directional_asymmetry", "lumen_taper", "adhesive_contact", "hertzian_contact", "load_force")
    refined_by = ("level_on_viscous",)

    growth_per_load = number(0.0, "1/(N or N m)", -1e3, 1e3, symbol="c")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return at_least(
            1 + sum(p[q.name] * np.abs(s.logged(q.name[len("growth_per_") :])) for q in self.parameters()), 0.05
        )


_SHORTEST_M = 1e-12
_SETTLED, _STRAIGHT = 1e-9, 1e-3  # keep powers of the way to go, and of an exponent of 1, finite


class Presliding(Effect):
    """Friction with memory: it follows the stretch z of a spring in place of `sgn(v)`,
    `z' = v/d |1 - z sgn(v)|^n`, and after a reversal reaches its new side over a few break-away distances d.
    """

    id = "presliding"
    source = "Dahl, AIAA J. 14 (1976) 1675"
    symbols = by_name(stretch="z")
    kinds = frozenset({"axis"})
    states = ("stretch",)
    needs = ("reversals",)
    probe = 1e-4
    confounders = ("spring_over_position", "stribeck", "sensor_delay", "elastic_drive")

    distance_m = number(0.0, "m", 0.0, 0.1, symbol="d")
    exponent = number(1.0, "1", 1.0, 3.0, "Dahl: 1; more where springs of many lengths slip one by one", symbol="n")

    def direction(self, s: Signals, p: Values, z: Values) -> Value:
        stretched = np.where(p["distance_m"] > _SHORTEST_M, z["stretch"], s.direction)
        return shown_as(stretched, lambda: z["stretch"])

    def advance(self, s: Signals, p: Values, z: Values, h: Value) -> dict[str, Value]:
        way, bend = np.sign(s.v), np.maximum(p["exponent"] - 1, _STRAIGHT)
        path = np.abs(s.v) * h / np.maximum(p["distance_m"], _SHORTEST_M)
        left = (np.maximum(1 - way * z["stretch"], _SETTLED) ** (-bend) + bend * path) ** (-1 / bend)
        return {"stretch": np.where(np.abs(s.v) > 0, way * (1 - left), z["stretch"])}

    @classmethod
    def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
        left = 1 - z["stretch"] * np.sign(s.v)
        return {"stretch": [equal(Formula("z'"), s.v / p["distance_m"] * np.abs(left) ** p["exponent"])]}


class Warming(Effect):
    """Scale `1 - a (1 - exp(-s/L))` over the path s: friction falls as the work that it takes warms it. Where a
    temperature is logged: `exp(-c (T - 20 degC))`.
    """

    id = "warming"
    source = "viscosity of lubricants over temperature; Carlson et al., friction of joints after 1 h of motion"
    kinds = frozenset({"axis"})
    needs = ("places",)
    grid = by_name(length_m=(0.3, 3.0))
    probe = 0.05
    confounders = ("load_force", "load_dependent_friction")
    refined_by = ("level_on_viscous",)

    fall = number(0.0, "1", -2.0, 0.95, symbol="a")
    length_m = number(1.0, "m", 0.01, 100.0, symbol="L")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return 1 - p["fall"] * (1 - np.exp(-s.travelled / p["length_m"]))


_LEAST_N = 1e-9  # load whose power is finite


class HertzianContact(Effect):
    """Scale `(|N|/N_r)^n`: n is -1/3 for a sphere on a soft solid, 0 where friction is proportional to the load. N_r is
    the load at which the coefficient is stated.
    """

    id = "hertzian_contact"
    source = "Bowden and Tabor: friction goes with the true area; Hertz 1882: N^(2/3), an exponent of -1/3 of the level"
    kinds = frozenset({"friction"})
    needs = ("load",)
    probe = -0.05
    confounders = ("load_dependent_friction", "adhesive_contact")

    exponent = number(0.0, "1", -0.9, 1.0, symbol="n")
    reference_N = number(1.0, "N", 1e-6, 1e9, fit=False, symbol="N_r")

    def level(self, s: Signals, p: Values, z: Values) -> Value:
        return (at_least(np.abs(s.load), _LEAST_N) / p["reference_N"]) ** p["exponent"]


class AdhesiveContact(Effect):
    """`F = mu (N + N_0)`: the coefficient that is referred to the applied load N falls as that load grows."""

    id = "adhesive_contact"
    source = "Derjaguin 1934: friction of adhering surfaces, mu (N + N_0)"
    kinds = frozenset({"friction"})
    needs = ("load",)
    probe = 0.02
    confounders = ("load_dependent_friction", "hertzian_contact")

    load_N = number(0.0, "N", -10.0, 100.0, symbol="N_0")

    def normal_load(self, s: Signals, p: Values, z: Values) -> Value:
        return p["load_N"]


class MagnetNormalLoad(Effect):
    """Normal load `N_m/(1 + (d/w)^2)^2` on the distance d of carriage and capsule: most where the magnet stands above
    the capsule. For rigs that state only the spring; with `[rig.magnet]` the load follows from both moments.
    """

    id = "magnet_normal_load"
    source = "K. W. Yung et al., Magn. Electr. Sep. 9 (1998) 39: two dipoles attract each other across the gap"
    kinds = frozenset({"magnetic"})
    needs = ("both_ways",)
    grid = by_name(width_m=(0.012, 0.03))
    probe = 0.2
    confounders = ("stribeck", "coupling_decay")

    load_N = number(0.0, "N", 0.0, 5.0, symbol="N_m")
    width_m = number(0.02, "m", 0.003, 0.3, symbol="w")

    def normal_load(self, s: Signals, p: Values, z: Values) -> Value:
        apart = (s.command - s.x) / p["width_m"]
        return p["load_N"] / (1 + apart * apart) ** 2
