"""The printed equation of each effect against the one of the literature, as trees."""

from typing import Any

import numpy as np
import pytest

from models.effects import CATALOGUE, EFFECTS
from models.effects.equation import equations_of
from models.formula import Formula, called, equal, parts_of, symbols

a, b, c, d, e, f, g, i, k, m, n, q, r, s, t, u, v, w, x, y, z = symbols("a b c d e f g i k m n q r s t u v w x y z")
A, F, G, K, L, N, alpha, delta, epsilon, phi, tau, theta, xi = symbols(
    "A F G K L N alpha delta epsilon phi tau theta xi"
)
F_d, F_g, N_0, N_m, N_r, k_3, m_a, t_a, t_s, t_w = symbols("F_d F_g N_0 N_m N_r k_3 m_a t_a t_s t_w")
u_0, u_c, u_cmd, u_w, v_0, v_i, v_s, x_0, x_m, xi_0, y_0 = symbols("u_0 u_c u_cmd u_w v_0 v_i v_s x_0 x_m xi_0 y_0")
u_rate, u_cmd_rate, u_w_rate, v_rate, y_rate, xi_rate = symbols("u' u_cmd' u_w' v' y' xi'")
LEVEL, TENSION, DRIVE, COIL = (Formula(f"{one} scale") for one in ("friction", "tension", "drive", "coil"))
F_EXTRA, N_EXTRA, F_WALL, F_SPRING, F_LINK, G_EXTRA = symbols("F_extra N_extra F_wall F_spring F_link G_extra")
PI_2 = Formula.of(2 * np.pi)
sgn, exp, sin, cos = np.sign, np.exp, np.sin, np.cos


def fourier(orders: range) -> Any:
    """`b_k sin kq + c_k cos kq`, summed over the `orders`."""
    return sum(Formula(f"b_{o}") * sin(o * q) + Formula(f"c_{o}") * cos(o * q) for o in orders)


DRIFT = [("t_e", t / (1 + t / t_s))]
PULL = w**2 * c + 2 * Formula("zeta") * w * (v - Formula("v_l"))  # of a spring and a damper
TEXTBOOK: dict[str, list[Any]] = {
    # friction: Armstrong-Helouvry 1991; Dieterich 1979 (ageing); Bowden and Tabor, Hertz 1882; Derjaguin 1934
    "stribeck": [equal(LEVEL, 1 + a * exp(-((abs(v) / v_s) ** delta)))],
    "directional_asymmetry": [equal(LEVEL, 1 + a * sgn(v))],
    "fold_periodic": [equal(LEVEL, 1 + a * (sin(q) + fourier(range(2, 4)))), ("q", PI_2 * x / L + phi)],
    "lumen_taper": [
        equal(LEVEL, 1 + g * y + b * y**2 + c * y**3),
        ("r", x - x_m),
        ("y", r / np.sqrt(1 + (r / L) ** 2)),
    ],
    "stenosis": [
        equal(LEVEL, 1 + a * (1 + m * (m + 1) / 2 * q**2) ** (-1 / m)),
        ("r", x - x_0),
        ("q", r / (w * (1 + k * sgn(r)))),
    ],
    "dwell_adhesion": [
        equal(LEVEL, 1 + b * theta),
        equal(Formula("theta'"), np.where(v == 0, (1 - theta) / t_a, -abs(v) * theta / L)),
    ],
    "preconditioning": [equal(LEVEL, 1 - a * (1 - (1 - q) * exp(-s / L) - q * exp(-5 * s / L)))],
    "tissue_drying": [equal(LEVEL, 1 + b * Formula("t_e") + c * Formula("t_e") ** 2), *DRIFT],
    "load_dependent_friction": [equal(LEVEL, 1 + c * abs(N))],
    "hertzian_contact": [equal(LEVEL, (abs(N) / N_r) ** n)],
    "adhesive_contact": [equal(N_EXTRA, N_0)],
    "magnet_normal_load": [equal(N_EXTRA, N_m / (1 + ((u_cmd - x) / w) ** 2) ** 2)],
    # a plug of liquid that grows by what is swept and leaks by as much at its full length
    "fluid_plug": [
        equal(F_EXTRA, -c * v * np.maximum(q * sgn(v), 0.0)),
        equal(Formula("q'"), v - abs(v) * q / L),
    ],
    # axes: Dahl 1976; heat of friction; statics; cogging; two masses on a spring
    "presliding": [equal(Formula("s_F"), z), equal(Formula("z'"), v / d * abs(1 - z * sgn(v)) ** n)],
    "warming": [equal(LEVEL, 1 - a * (1 - exp(-s / L)))],
    "load_force": [equal(F_EXTRA, c * N * (1 + g * (x - x_m)))],
    "torque_ripple": [
        equal(F_EXTRA, -(A * sin(q) + (Formula("b_2") * sin(2 * q) + Formula("c_2") * cos(2 * q)))),
        ("q", PI_2 * x / L + phi),
    ],
    "elastic_drive": [
        equal(F_EXTRA, -m * (w**2 * e + 2 * Formula("zeta") * w * (v - Formula("v_l")))),
        equal(Formula("e'"), v - Formula("v_l")),
        equal(Formula("v_l'"), w**2 * e + 2 * Formula("zeta") * w * (v - Formula("v_l"))),
        ("w", PI_2 * f),
        ("w", PI_2 * f),
    ],
    "drive_play": [
        equal(F_EXTRA, -m * np.where(abs(e) > b / 2, PULL, 0)),
        equal(Formula("e'"), v - Formula("v_l")),
        equal(Formula("v_l'"), np.where(abs(e) > b / 2, PULL, 0) - Formula("r") * sgn(Formula("v_l"))),
        *[("w", PI_2 * f), ("c", e - np.clip(e, -b / 2, b / 2))] * 2,
    ],
    # forces: power law of a fluid; Maxwell branch with LuGre's slip (Canudas 1995) and Cross's thinning (1965)
    "viscous_drag": [equal(F_EXTRA, -c * sgn(v) * (abs(v) / v_0) ** n), ("v_0", 0.01)],
    "incline_gravity": [equal(F_EXTRA, F_g)],
    "stress_relaxation": [
        equal(F_EXTRA, -k * q),
        equal(Formula("q'"), v / (1 + b * abs(v)) - q / tau - c * abs(v) * q),
    ],
    "respiration": [equal(F_EXTRA, A * (sin(q) + Formula("o") + fourier(range(2, 5)))), ("q", PI_2 * f * t + phi)],
    "peristaltic_wave": [
        equal(F_EXTRA, A * (sin(q) + Formula("o") + fourier(range(2, 5)))),
        ("q", PI_2 * (f * t - k * x) + phi),
    ],
    "added_mass": [equal(F_EXTRA, -m_a * v_rate)],
    "spring_over_position": [equal(F_EXTRA, -k * x)],
    "gravity_over_angle": [equal(F_EXTRA, -G * sin(x - x_0))],
    # wall: Kelvin-Voigt; a Weibull-like fading of stiffness; fractional Kelvin-Voigt (springpot)
    "wall_viscosity": [equal(F_WALL, c * u_w_rate)],
    "small_strain_stiffening": [equal(TENSION, 1 + a * (1 + m * abs(u_w) / u_0) ** (-1 / m))],
    "exponential_recovery": [equal(v_i, Formula("v_i0") * (1 - q + q * m * abs(u_w) / u_c))],
    "broad_relaxation": [equal(G_EXTRA, K * (i * f / Formula("f_0")) ** alpha), ("f_0", 10.0)],
    # drive: first-order lag; Duhem's operator (Su et al. 2000); fibres that harden exponentially; Prandtl's stop
    "actuator_lag": [equal(tau * u_rate, u_cmd - u)],
    "carriage_backlash": [
        equal(u_rate, u_cmd_rate * (exp(k * q**n) - 1) / (exp(k) - 1)),
        ("q", 0.5 + (u_cmd - u) * sgn(u_cmd_rate) / b),
        abs(u_cmd - u) <= b / 2,
    ],
    "string_compliance": [equal(F_LINK, np.sinh(b * e) / (b * c) + d * Formula("e'"))],
    "coupling_decay": [equal(DRIVE, 1 + g * x + b * x**2)],
    "coupling_fade": [equal(DRIVE, 1 + b * Formula("t_e") + c * Formula("t_e") ** 2), *DRIFT],
    "actuator_dead_zone": [equal(u, sgn(u_cmd) * np.maximum(abs(u_cmd) - d, 0))],
    "actuator_saturation": [equal(DRIVE, 1 / (1 + a * u_cmd**2))],
    "magnetic_hysteresis": [equal(u, u_cmd + r * z), equal(Formula("z'"), u_cmd_rate / w), abs(z) <= 1],
    "back_emf": [equal(u, u_cmd - K * v)],
    "coil_lag": [equal(u, i**2), equal(tau * Formula("i'"), np.sqrt(u_cmd) - i)],
    "coil_reach": [equal(COIL, exp(g * xi))],
    # sensor
    "sensor_bias": [equal(y, y_0 + b)],
    "sensor_scale": [equal(y, (1 + epsilon) * y_0)],
    "sensor_drift": [equal(y, y_0 + c * (t + k * t_w * (1 - exp(-t / t_w))))],
    "sensor_delay": [equal(y, called("y_0", t - d))],
    "sensor_lowpass": [equal(tau * y_rate, y_0 - y)],
    "mains_hum": [equal(y, y_0 + A * sin(PI_2 * f * t + phi))],
    # inner mass: Duffing's spring, Coulomb's friction made smooth, a Kelvin-Voigt stop that never pulls
    "spring_damping": [equal(F_SPRING, c * xi_rate)],
    "spring_hardening": [equal(F_SPRING, k_3 * xi_0**2 * (abs(xi) / xi_0) ** (n - 1) * xi), ("xi_0", 0.01)],
    "guide_friction": [equal(F_SPRING, F_d * xi_rate / np.sqrt(xi_rate**2 + v_0**2)), ("v_0", 0.002)],
    "end_stop_impact": [
        equal(F_SPRING, k * np.where(d > 0, sgn(xi) * np.maximum(d + t_s * sgn(xi) * xi_rate, 0), 0)),
        ("d", np.maximum(abs(xi) - g, 0)),
    ],
}


def normal(formula: Formula) -> Any:
    """A tree in which the order of terms and of factors, and how they are bracketed, make no difference."""
    if formula.number is not None:
        return ("number", float(f"{formula.number:.12g}"))
    if formula.name == "+":
        terms = [term for one in map(normal, formula.inputs) for term in (one[1] if one[0] == "+" else (one,))]
        return ("+", tuple(sorted(terms, key=repr)))
    if formula.name in ("*", "/", "neg"):
        over, under, sign = factors(formula)
        return ("*", sign, tuple(sorted(over, key=repr)), tuple(sorted(under, key=repr)))
    return (formula.name, tuple(map(normal, formula.inputs)))


def factors(formula: Formula) -> tuple[list[Any], list[Any], float]:
    """Factors above and below the line, and the number before them."""
    if formula.name == "neg":
        over, under, number = factors(formula.inputs[0])
        return over, under, -number
    if formula.name in ("*", "/"):
        (over, under, number), (second, third, other) = map(factors, formula.inputs)
        if formula.name == "/":
            return over + third, under + second, number / other
        return over + second, under + third, number * other
    return ([], [], formula.number) if formula.number is not None else ([normal(formula)], [], 1.0)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.id)
def test_the_printed_equation_is_the_textbooks(effect: Any) -> None:
    printed = [
        part for formula in equations_of(effect) for whole, more in [parts_of(formula)] for part in (whole, *more)
    ]
    book = [equal(Formula(one[0]), one[1]) if isinstance(one, tuple) else one for one in TEXTBOOK[effect.id]]
    assert sorted(map(repr, map(normal, printed))) == sorted(map(repr, map(normal, book)))


def test_every_effect_has_a_textbook() -> None:
    assert set(TEXTBOOK) == {effect.id for effect in EFFECTS}
    assert len(CATALOGUE) > len(TEXTBOOK)
