"""The base model: stick and slip of the wall that the capsule drags along, from papers A, C and V."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from models.formula import Formula, Line, called, equal, polynomial, symbols
from models.laws.five_elements import blend_weight
from models.laws.geometry import GRAVITY, Capsule, Regime, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants, wall_tension
from models.laws.resistance import mucus_drag, pressure_integrals
from models.parameter import Parameter
from models.surfaces.surface import FULL, Held, Levels, Surface, Values

FAST, FASTEST = 0.3, 1.0  # m/s, ends of the fitted ranges of the pressure integrals; a shaken body reaches 0.4
LONGEST = 3e-3  # m, end of the fitted range of the wall drag
_KNEE = 3e-3  # m/s, about which the fitted polynomial is finest
_DEGREE, _DEGREE_BEYOND = 12, 4  # of the polynomials up to `FAST` and beyond
_TINY = 1e-12  # a difference that is none, in m or N


Fitted = tuple[tuple[float, ...], tuple[float, ...]]
"""Coefficients of an integral up to `FAST`, and beyond."""


def _integral(speed: Any, sets: tuple[Fitted, ...]) -> Any:
    """One of V's integrals in N at `speed` >= 0 in m/s, from the polynomials of each set of moduli."""
    at, end = np.log1p(np.minimum(speed, FASTEST) / _KNEE), np.log1p(FAST / _KNEE)
    slow, *fast = (np.where(at < end, polynomial(at, *below), polynomial(at, *beyond)) for below, beyond in sets)
    return slow + blend_weight(speed) * (fast[0] - slow) if fast else slow


@dataclass(frozen=True)
class Wall(Surface):
    """The gut around one capsule: pressure integrals against speed, tension against drag.

    V's integrals I1 (`nose_coefficients`) and I2 at the nominal hoop stress are polynomials in log(1 + v/3 mm/s), one
    up to 0.3 m/s and one beyond, that follow the quadrature within 2e-4 up to 1 m/s, so that NumPy and CasADi share
    them: for each set of moduli in use, two where the tissue's regime blends them.
    """

    dragged: ClassVar[bool] = True
    capsule: Capsule
    tissue: Tissue
    nose_coefficients: tuple[Fitted, ...]
    cylinder_coefficients: tuple[Fitted, ...]
    drag_coefficients: tuple[float, ...]
    tension_coefficients: tuple[float, ...]

    @classmethod
    def around(cls, capsule: Capsule, tissue: Tissue) -> Wall:
        """The wall of the seeds' tables around `capsule`."""
        speed = np.r_[np.linspace(0, 2e-3, 300), np.geomspace(2e-3, FAST, 800), np.geomspace(FAST, FASTEST, 200)]
        ranges = slice(0, 1100), slice(1100, None)

        def fitted(integral: Any) -> Fitted:
            at = np.log1p(speed / _KNEE)
            below, beyond = (
                np.polynomial.Chebyshev.fit(at[part], integral[part], degree, w=1 / integral[part]).convert(
                    kind=np.polynomial.Polynomial
                )
                for part, degree in zip(ranges, (_DEGREE, _DEGREE_BEYOND), strict=True)
            )
            end = np.log1p(FAST / _KNEE)
            beyond = beyond * (below(end) / beyond(end))
            return tuple(map(float, below.coef)), tuple(map(float, beyond.coef))

        pure: tuple[Regime, ...] = ("low", "high") if tissue.regime == "blend" else (tissue.regime,)
        sets = [pressure_integrals(speed, capsule, replace(tissue, regime=regime)) for regime in pure]
        nose, cylinder = (tuple(map(fitted, integral)) for integral in zip(*sets, strict=True))
        u = np.linspace(0, LONGEST, 400)
        force = wall_tension(u, WallConstants.from_set(), wall_section(capsule, tissue), stretched_length(capsule))
        inverse = np.polynomial.Polynomial.fit(force, u, 7).convert().coef
        forward = np.polynomial.Polynomial.fit(u[1:] / LONGEST, force[1:] / u[1:], 7, window=[-1, 1]).convert().coef
        drag, tension = (tuple(float(c) for c in row) for row in (inverse, forward))
        return cls(capsule, tissue, nose, cylinder, drag, tension)

    @property
    def body_kg(self) -> float:
        return self.capsule.mass_kg

    @property
    def recovery_time_s(self) -> float:
        return self.tissue.recovery_time_s

    def parameters(self) -> tuple[Parameter, ...]:
        mu, source = self.tissue.friction_coefficient, "paper V Eq. 13; tissue differs by 15 % and more"
        return (
            Parameter("hoop_stress_factor", 1.0, "1", 0.65, 1.45, source, fit=True),
            Parameter.near("friction_coefficient", mu, "1", 0.6, 1.6, "rig file; paper V: 0.082"),
        )

    def hold(self, speed: Any, p: Values, carried_kg: float = 0.0, levels: Levels = FULL, pressing: Any = 0.0) -> Held:
        """Environmental resistance `F_e = sin(theta) c I1` and slip limit `f_c = mu (m g + c (cos(theta) I1 + I2))` in
        N with the rig's factor c on the hoop stress, carried and pressing loads added; paper V Eq. 8, 11, 12.
        """
        hoop, mu = p["hoop_stress_factor"], p["friction_coefficient"]
        on_nose, on_weight, on_pressed = levels
        nose = hoop * _integral(speed, self.nose_coefficients)
        cylinder = hoop * _integral(speed, self.cylinder_coefficients)
        load = on_weight * self.capsule.mass_kg * GRAVITY + on_pressed * (math.cos(self.tissue.theta) * nose + cylinder)
        onset = mu * load + mu * (on_weight * carried_kg * GRAVITY + pressing)
        return on_nose * math.sin(self.tissue.theta) * nose, onset

    def mucus(self, w: Any) -> Any:
        return mucus_drag(w, self.tissue.mucus_thickness_m)

    def equations(self, p: Values) -> list[Line]:
        c, mu = (Formula.of(p[name]) for name in ("hoop_stress_factor", "friction_coefficient"))
        m, a, g, F_act, F_e, f_c, v, theta = symbols("m a g F_act F_e f_c v theta")
        u, rate, u_c, v_i, t_r, w = symbols("u_w u_w' u_c v_i t_r w")
        I_1, I_2 = (called(name, np.abs(v)) for name in ("I_1", "I_2"))
        T, side = called("T", u), np.sign(u)
        return [
            [equal(m * a, F_act - F_e * called("Sgn", v) - called("F_v", w) - T)],
            [equal(F_e, c * np.sin(theta) * I_1)],
            [equal(f_c, mu * (m * g + c * (np.cos(theta) * I_1 + I_2)))],
            ["stick: ", equal(rate, v), " until ", equal(np.abs(T), f_c)],
            ["slip: ", equal(rate, -side * v_i), " until ", equal(u, 0), " or ", side * v <= -v_i],
            [equal(v_i, u_c / t_r)],
        ]

    def tension(self, u: Any) -> Any:
        """`T(u)` in N at the drag `u` in m (paper A Eq. 12), a polynomial within 1e-7 of the law up to 3 mm."""
        return u * polynomial(np.abs(u) / LONGEST, *self.tension_coefficients)

    def stiffness(self) -> float:
        """`dT/du` at u = 0 in N/m, about 150 for the default capsule."""
        return float(self.tension(1e-6)) / 1e-6

    def drag_at(self, tension: Any) -> Any:
        """`u_c` in m with `T(u_c)` = `tension` >= 0 in N, a polynomial, within 1e-6 up to 3 mm of drag."""
        return polynomial(tension, *self.drag_coefficients)


@dataclass(frozen=True)
class Drag:
    """State of the dragged wall: displacement `u` in m, slip direction `slip` (0 while it sticks)."""

    u: Any
    slip: Any


def drag_rate(state: Drag, v: Any, recovery_speed: Any) -> Any:
    """`u'` in m/s: the capsule's speed while the wall sticks, `-s v_i` while it slips."""
    return np.where(state.slip == 0, v, -state.slip * recovery_speed)


def step_drag(state: Drag, v: Any, h: Any, limit: Any, tension: Any, recovery_speed: Any) -> Drag:
    """The wall after a step `h` in s at speed `v`: sticks until |T(u)| >= f_c = `limit`, then draws back at `v_i` until
    u = 0.

    `tension` maps u to the wall's tension in N; `recovery_speed` is `v_i = u_c/t_r` in m/s with `T(u_c) = f_c` at the
    present speed. An event inside the step is located by linear interpolation, so the error is second order in `h`. The
    wall also sticks while the capsule overtakes it backwards, `s v <= -v_i`, at any tension.
    """
    dragged = state.u + v * h
    before, after = np.abs(tension(state.u)), np.abs(tension(dragged))
    torn = np.where(np.sign(dragged) * v > -recovery_speed, after >= limit, False)
    late = np.where(torn, np.clip((after - limit) / np.maximum(after - before, _TINY), 0.0, 1.0), 0.0)
    side = np.where(torn, np.sign(dragged), 0.0)
    stick = Drag(dragged - late * h * (v + side * recovery_speed), side)
    drawn = state.u - state.slip * recovery_speed * h
    over = -state.slip * drawn
    rest = np.clip(over / np.maximum(recovery_speed * h, _TINY), 0.0, 1.0)
    overtaken = state.slip * v <= -recovery_speed
    slip = Drag(
        np.where(overtaken, dragged, np.where(over >= 0, v * rest * h, drawn)),
        np.where(overtaken, 0.0, np.where(over >= 0, 0.0, state.slip)),
    )
    sticking = state.slip == 0
    return Drag(np.where(sticking, stick.u, slip.u), np.where(sticking, stick.slip, slip.slip))


def settle(free: Any, stop: Any, smoothing: Any = 0.0) -> Any:
    """Speed in m/s after a step under friction: `free` without it, at most reduced by `stop` = F h/m.

    The implicit step of `F v/(|v| + eps)` in closed form, `|v| = (b + sqrt(b^2 + 4 eps |free|))/2` with `b = |free| -
    stop - eps`; at `smoothing` eps = 0 friction is set-valued: the body rests while `|free| <= stop`.
    """
    b = np.abs(free) - stop - smoothing
    root = np.sqrt(b * b + 4 * smoothing * np.abs(free))
    slides = np.sign(free) * (b + root) / 2
    if isinstance(smoothing, int | float) and smoothing == 0:
        return slides
    return np.where(b < 0, 2 * smoothing * free / (root + np.abs(b)), slides)  # the same, with its slope at free = 0
