"""The one list of hidden effects: name, form, numbers with ranges, and the drives that can have them."""

from collections import namedtuple
from dataclasses import dataclass, replace
from typing import Any, Final

from models.parameter import nearest

PULL, MAGNETIC, COIL, VIBRO, FORCE, AXIS = "pull", "magnetic", "coil", "vibro", "force", "axis"
"""The simulated drives by name; their true numbers are in `plant.drives`."""
CARRIED: Final = (PULL, MAGNETIC)
PUSHED: Final = (MAGNETIC, COIL)
RESTING: Final = (*CARRIED, COIL, FORCE)
GUT_DRIVES: Final = (*CARRIED, COIL, VIBRO, FORCE)
ANY: Final = (*GUT_DRIVES, AXIS)
LAG_SHARES: Final = (1 / 2, 1 / 3, 1 / 6)  # of a lag's time, one per stage
IN_A_ROW: Final = "three first-order lags in series, a/2, a/3 and a/6"
SIGNED: Final = -1.0  # third number of a range whose values may be negative


@dataclass(frozen=True)
class HiddenNumber:
    """One number of an effect, `unit` in its name; random rigs draw it from [`lower`, `upper`]."""

    name: str
    lower: float
    upper: float
    sign: float = 1.0

    @property
    def middle(self) -> float:
        return 0.5 * (self.lower + self.upper)


@dataclass(frozen=True)
class Hidden:
    """An effect with its equation `form`: `numbers[0]` is its amplitude, zero switches it off."""

    id: str
    form: str
    numbers: tuple[HiddenNumber, ...]
    drives: tuple[str, ...]


def _effect(form: str, ranges: dict[str, tuple[float, ...]], drives: tuple[str, ...] = ANY) -> Hidden:
    return Hidden("", form, tuple(HiddenNumber(name, *numbers) for name, numbers in ranges.items()), drives)


_BY_NAME: Final = {
    "stribeck": _effect("level (1 + a/(1 + (v/v_s)^2))", {"excess": (0.35, 0.8), "speed_m_s": (1.5e-3, 4e-3)}),
    "directional_asymmetry": _effect(
        "level (1 + a v/sqrt(v^2 + v_0^2))", {"excess": (0.12, 0.3, SIGNED), "speed_m_s": (1e-4, 4e-4)}
    ),
    "fold_periodic": _effect(
        "level (1 + a (sin q + 0.35 sin(2 q + 0.8))), q = 2 pi x/l + p",
        {"excess": (0.15, 0.35), "wavelength_m": (5e-3, 10e-3), "phase_rad": (0.0, 6.28)},
    ),
    "lumen_taper": _effect(
        "level (1 + a tanh((x - c)/w))",
        {"excess": (0.2, 0.4, SIGNED), "centre_m": (0.0, 6e-3), "width_m": (12e-3, 25e-3)},
    ),
    "stenosis": _effect(
        "level (1 + a cos^2) over 1 width before and 1.5 widths after the centre",
        {"excess": (0.6, 1.3), "centre_m": (2.5e-3, 9e-3), "width_m": (2.5e-3, 5e-3)},
    ),
    "tissue_drying": _effect("level (1 + a (1 - exp(-t/t_d)))", {"excess": (0.25, 0.5), "time_s": (18.0, 40.0)}),
    "preconditioning": _effect(
        "level (1 - a s/(s + s_0)), s the path", {"share": (0.25, 0.5), "path_m": (40e-3, 120e-3)}
    ),
    "dwell_adhesion": _effect(
        "level (1 + a b (1 - s/d)^2), b' = (1 - b)^2/t_a at rest, s the path since",
        {"excess": (0.6, 1.2), "time_s": (0.4, 1.2), "path_m": (0.6e-3, 1.5e-3)},
        RESTING,
    ),
    "nose_asymmetry": _effect(
        "resistance (1 + a v/sqrt(v^2 + v_0^2)), the slip limit as it was",
        {"excess": (0.12, 0.3, SIGNED), "speed_m_s": (1e-5, 1e-4)},
        RESTING,
    ),
    "film_weakening": _effect(
        "resistance + a/(1 + |v|/v_s), the slip limit as it was",
        {"force_N": (12e-3, 24e-3), "speed_m_s": (1.5e-3, 4e-3)},
        RESTING,
    ),
    "slip_folds": _effect(
        "slip limit's hoop stress (1 + a sin q (1 + 0.5 cos q)), q = 2 pi x/l, resistance as it was",
        {"excess": (0.2, 0.4), "wavelength_m": (5e-3, 10e-3)},
        RESTING,
    ),
    "travel_step": _effect(
        "level (1 + a) once a path d is done, over 1 mm", {"excess": (0.25, 0.5, SIGNED), "path_m": (40e-3, 80e-3)}
    ),
    "rolling_wobble": _effect(
        "level (1 + a sin p), p' = 2 pi (|v|/l + sqrt(|v|/l) sqrt(f_0))",
        {"excess": (0.2, 0.4), "length_m": (4e-3, 8e-3), "frequency_Hz": (0.3, 0.8)},
    ),
    "attraction_load": _effect(
        "resistance + a (g/g_0)^2 on the gap g", {"force_N": (3e-3, 7e-3), "gap_m": (3e-3, 4e-3)}, (MAGNETIC,)
    ),
    "viscous_drag": _effect("-a sgn(v) (|v|/10 mm/s)^0.85", {"force_N": (10e-3, 30e-3)}),
    "peristaltic_wave": _effect(
        "a max(0, sin(2 pi (t/T - x/l))), pulses of half a period",
        {"force_N": (12e-3, 25e-3), "period_s": (3.0, 7.0), "wavelength_m": (25e-3, 60e-3)},
    ),
    "respiration": _effect("a (2 |cos(pi t/T)|^3 - 0.85)", {"force_N": (8e-3, 18e-3), "period_s": (3.0, 5.0)}),
    "incline_gravity": _effect("-m g sin(angle)", {"angle_rad": (0.25, 0.6, SIGNED)}),
    "fluid_plug": _effect(
        "-a sgn(v) (|v|/10 mm/s)^0.8 s/(s + l), s the path since the last reversal",
        {"force_N": (25e-3, 60e-3), "path_m": (15e-3, 40e-3)},
    ),
    "stress_relaxation": _effect(
        "-a q, q' = v/d (1 - q sgn v) - q sqrt|q|/t_r",
        {"force_N": (15e-3, 30e-3), "path_m": (1.5e-3, 4e-3), "time_s": (0.8, 2.5)},
    ),
    "added_mass": _effect("(m + a) v'", {"mass_kg": (0.1, 0.3)}),
    "wall_viscosity": _effect("T + a sgn(u') (|u'|/10 mm/s)^0.9", {"force_N": (10e-3, 25e-3)}),
    "exponential_recovery": _effect("in slip u' = -a u_c (0.15 + (|u|/u_c)^0.8)/t_r", {"rate": (1.5, 2.5)}),
    "small_strain_stiffening": _effect(
        "T (1 + a/(1 + (|u|/u_0)^1.2))", {"excess": (1.0, 2.5), "drag_m": (80e-6, 250e-6)}
    ),
    "string_compliance": _effect(
        "force k e (1 + (e/e_0)^2) on the link's stretch e, a = 1/k",
        {"compliance_m_per_N": (5e-3, 15e-3), "scale_m": (1.5e-3, 4e-3)},
        (PULL,),
    ),
    "coupling_decay": _effect(
        "gain (1 - a (1 + tanh((x - 5 mm)/l))/2)", {"share": (0.2, 0.4), "length_m": (10e-3, 20e-3)}, PUSHED
    ),
    "coupling_fade": _effect("gain (1 - a (1 - exp(-t/t_h)))", {"share": (0.2, 0.4), "time_s": (12.0, 30.0)}, PUSHED),
    "dipole_load": _effect(
        "load a (1 - 3/2 q)/(1 + q)^(7/2) across the lumen, q = (g/h)^2 on the gap g",
        {"load_N": (0.5, 1.0), "height_m": (12e-3, 20e-3)},
        (MAGNETIC,),
    ),
    "actuator_lag": _effect(IN_A_ROW, {"time_s": (0.06, 0.16)}, (PULL, *PUSHED)),
    "driver_lag": _effect(IN_A_ROW, {"time_s": (2e-3, 6e-3)}, (VIBRO,)),
    "carriage_backlash": _effect("play of width a whose ends are rounded", {"width_m": (1.0e-3, 2.5e-3)}, CARRIED),
    "actuator_dead_zone": _effect("current below a does nothing, rounded", {"current_A": (0.05, 0.12)}, (COIL,)),
    "actuator_saturation": _effect("force F/(1 + |F/a|^3)^(1/3)", {"force_N": (0.08, 0.12)}, PUSHED),
    "magnetic_hysteresis": _effect(
        "force + a z, z' = (1 - z|z| sgn(d'))d'/d_0 on the drive d",
        {"force_N": (10e-3, 25e-3), "scale": (1.5e-3, 3e-3)},
        PUSHED,
    ),
    "back_emf": _effect("voltage - a v (1 + |v|/0.2 m/s)", {"gain_V_s_per_m": (5.0, 15.0)}, (COIL,)),
    "spring_damping": _effect("-a r' (1 + |r'|/0.5 m/s)", {"damping_N_s_per_m": (0.2, 0.8)}, (VIBRO,)),
    "end_stop_impact": _effect(
        "stops at +-a, k d (1 + 1.5 s/m d')", {"gap_m": (2e-3, 4e-3), "stiffness_N_per_m": (5e3, 2e4)}, (VIBRO,)
    ),
    "spring_stiffening": _effect(
        "-a r (sqrt(1 + (r/l)^2) - 1)", {"stiffness_N_per_m": (40.0, 120.0), "length_m": (3e-3, 6e-3)}, (VIBRO,)
    ),
    "guide_rubbing": _effect(
        "-a r'/(|r'| + 3 mm/s) (1 + exp(-|r'|/0.15 m/s)/2)", {"friction_N": (0.02, 0.06)}, (VIBRO,)
    ),
    "coil_field": _effect(
        "coil's force (1 - a tanh(r/l))", {"share": (0.2, 0.45, SIGNED), "length_m": (6e-3, 12e-3)}, (VIBRO,)
    ),
    "sensor_drift": _effect(
        "a log(1 + t/t_0), in spans of the sensor", {"span": (0.06, 0.15, SIGNED), "time_s": (8.0, 20.0)}
    ),
    "sensor_bias": _effect("a, in spans of the sensor", {"span": (0.05, 0.12, SIGNED)}),
    "sensor_scale": _effect("1 + a", {"excess": (0.08, 0.2, SIGNED)}),
    "sensor_delay": _effect("y(t - a)", {"time_s": (0.04, 0.12)}),
    "sensor_lowpass": _effect(IN_A_ROW, {"time_s": (0.06, 0.16)}),
    "mains_hum": _effect("a (sin 2 pi 50 t + 0.3 sin 2 pi 150 t), in spans of the sensor", {"span": (0.02, 0.05)}),
}
HIDDEN: Final = tuple(replace(one, id=name) for name, one in _BY_NAME.items())
ONSET: Final = 3  # position in an effect's row of its onset time in s; 0: from the beginning
ROWS: Final = {effect.id: row for row, effect in enumerate(HIDDEN)}
ROW: Final[Any] = namedtuple("Row", ROWS)(**ROWS)  # the rows as constants of compiled steps: `ROW.stribeck`


def hidden(name: str) -> Hidden:
    """The effect called `name`; `ValueError` names the nearest one."""
    if name not in ROWS:
        raise ValueError(f"hidden effect must be one of the registry; got {name!r}; {nearest(name, ROWS)}")
    return HIDDEN[ROWS[name]]
