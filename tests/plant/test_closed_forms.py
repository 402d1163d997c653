"""Answers known without the plant: capsubots, belt stick-slip, an internal push, symmetry, rest, energy."""

import numpy as np
import pytest

from models.laws.geometry import GRAVITY, Capsule, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants, wall_tension
from models.laws.resistance import environmental_resistance
from plant import layout as at
from plant.drives import TrueCoil, TrueMagnet, TruePull, TrueVibro
from plant.experiments.profile import pulse_width
from plant.rig import STEP_S, Plant, TruePlate, Truth
from plant.tables import Floats
from tests.plant.force import Force

BIG = Truth(TrueVibro(0.074, 256.23, force_N=1.25), capsule=Capsule(mass_kg=0.193), surface=TruePlate(0.29))
SMALL = Truth(
    TrueVibro(0.0231, 360.0, force_N=0.8), capsule=Capsule(mass_kg=0.0213), surface=TruePlate(0.7 / (0.0444 * GRAVITY))
)


def steady_speed(rig: Truth, period_s: float, duty: float, settle: int = 100, cycles: int = 100) -> float:
    assert isinstance(rig.drive, TrueVibro)
    plant = Plant(rig)
    drive = rig.drive.force_N * pulse_width(period_s, duty, (settle + cycles) * period_s, STEP_S)
    rows = plant.advance(drive)
    ends = np.interp(
        [settle * period_s - STEP_S, (settle + cycles) * period_s - STEP_S], rows[:, at.O_T], rows[:, at.O_X]
    )
    return float(np.diff(ends)[0] / (cycles * period_s))


@pytest.mark.parametrize(
    ("rig", "period_s", "duty", "speed_m_s"),
    [(BIG, 0.060, 0.3, -8.275e-3), (BIG, 0.097, 0.14, 19.625e-3), (SMALL, 0.0441, 0.785, -75.85e-3)],
)
def test_capsubot_runs_at_the_exact_solver_s_speed(rig: Truth, period_s: float, duty: float, speed_m_s: float) -> None:
    assert steady_speed(rig, period_s, duty) == pytest.approx(speed_m_s, rel=2e-3)


@pytest.mark.parametrize(("period_s", "duty"), [(0.06, 0.3), (0.06, 0.45), (0.097, 0.14), (0.05, 0.2)])
def test_capsubot_mirrors_its_duty(period_s: float, duty: float) -> None:
    assert steady_speed(BIG, period_s, duty) == pytest.approx(-steady_speed(BIG, period_s, 1 - duty), abs=2e-6)


@pytest.mark.parametrize("period_s", [0.05, 0.06])
def test_half_duty_goes_nowhere(period_s: float) -> None:
    assert abs(steady_speed(BIG, period_s, 0.5)) < 1e-9


@pytest.mark.parametrize(("step_s", "tolerance"), [(1e-3, 2e-3), (1e-4, 2e-4), (STEP_S, 4e-5)])
def test_belt_stick_slip_has_its_closed_form_period(step_s: float, tolerance: float) -> None:
    """`T = 2 a/v_b + (2/w)(pi - atan(a w/v_b))`, a = (F_s - F_k)/k, for m = k = 1, v_b = 0.2, F_s = 1, F_k = 0.5."""
    rig = Truth(
        TrueMagnet(1.0, 1e9),
        capsule=Capsule(mass_kg=1.0),
        surface=TruePlate(0.5 / GRAVITY, 1.0 / GRAVITY),
        step_s=step_s,
    )
    rows = Plant(rig).advance(0.2 * np.arange(0.0, 40.0, step_s))
    moving = rows[:, at.O_V] != 0.0
    starts = rows[1:, at.O_T][moving[1:] & ~moving[:-1]]
    exact = 2 * 0.5 / 0.2 + 2 * (np.pi - np.arctan(0.5 / 0.2))
    assert exact == pytest.approx(8.902605, abs=1e-6)
    assert np.diff(starts)[1:] == pytest.approx(exact, abs=tolerance)


def test_an_internal_push_ends_where_momentum_says() -> None:
    """`D = (u - F_k) u t^2/(2 M F_k)`: 6 mm for 20 g, 0.2 N for 20 ms against 50 mN."""
    rig = Truth(Force(), capsule=Capsule(mass_kg=0.02), surface=TruePlate(0.05 / (0.02 * GRAVITY)))
    push = np.where(np.arange(10_001) < 1000, 0.2, 0.0)
    assert Plant(rig).advance(push)[-1, at.O_X] == pytest.approx(6.0e-3, abs=1e-9)


@pytest.mark.parametrize("surface", [None, TruePlate(0.29)])
def test_an_hour_below_break_away_moves_exactly_nothing(surface: TruePlate | None) -> None:
    capsule = Capsule()
    break_away = 42.36e-3 if surface is None else 0.29 * capsule.mass_kg * GRAVITY
    plant = Plant(Truth(Force(), surface=surface))
    minute = np.full(3_000_001, 0.999 * break_away)
    for _ in range(60):
        rows = plant.advance(minute, 50_000)
        assert not rows[:, (at.O_X, at.O_V, at.O_U)].any()
    assert plant.time == pytest.approx(3600.0)
    assert plant.state[at.S_X] == plant.state[at.S_U] == 0.0


@pytest.mark.parametrize("surface", [None, TruePlate(0.29)])
def test_two_minutes_of_a_changing_force_below_break_away_move_exactly_nothing(surface: TruePlate | None) -> None:
    break_away = 42.36e-3 if surface is None else 0.29 * Capsule().mass_kg * GRAVITY
    plant = Plant(Truth(Force(), surface=surface))
    rows = plant.advance(0.999 * break_away * np.sin(0.1 * np.arange(6_000_001)), 1000)
    assert not rows[:, (at.O_X, at.O_V, at.O_U)].any()


def test_a_vibrating_body_below_break_away_stays() -> None:
    rig = Truth(TrueVibro(force_N=0.2, reaction_on_body=False), capsule=Capsule(mass_kg=0.193), surface=TruePlate(0.29))
    rows = Plant(rig).advance(0.2 * pulse_width(0.03, 0.5, 20.0, STEP_S), 100)
    assert not rows[:, at.O_X].any()
    assert np.ptp(rows[:, at.O_INNER_X]) > 1e-4


def test_energy_of_the_capsubot_balances() -> None:
    """Kinetic and spring energy gained = work of the drive - friction's, over two seconds of sliding and sticking."""
    rig, vibro = BIG, BIG.drive
    assert isinstance(vibro, TrueVibro)
    plant = Plant(rig)
    rows = plant.advance(1.25 * pulse_width(0.097, 0.14, 2.0, STEP_S))
    v, inner_v, force = rows[:, at.O_V], rows[:, at.O_INNER_V], rows[:, at.O_FORCE]
    r = rows[:, at.O_INNER_X] - rows[:, at.O_X]
    energy = 0.5 * 0.193 * v**2 + 0.5 * vibro.inner_mass_kg * inner_v**2 + 0.5 * vibro.spring_stiffness_N_per_m * r**2
    work = np.sum(force[:-1] * np.diff(r))
    friction = 0.29 * (0.193 + 0.074) * GRAVITY * np.sum(np.abs(np.diff(rows[:, at.O_X])))
    assert energy[-1] - energy[0] == pytest.approx(work - friction, abs=3e-3 * work)


def test_energy_of_a_pull_through_a_link_goes_into_wall_and_resistance() -> None:
    """While the wall sticks: work at the link = kinetic + wall + F_e path (the wall's energy is lost only when it
    slips).
    """
    plant = Plant(Truth(Force()))
    rows = plant.advance(np.full(2000, 0.060))
    assert np.all(plant.state[at.S_SLIP] == 0.0)
    x, u = rows[:, at.O_X], rows[:, at.O_U]
    assert np.array_equal(x, u)
    stored = np.sum(0.5 * (_tension(u[1:]) + _tension(u[:-1])) * np.diff(u))
    resisting = _resistance(rows[:, at.O_V])
    lost = np.sum(0.5 * (resisting[1:] + resisting[:-1]) * np.diff(x))
    kinetic = 0.5 * 4e-3 * rows[-1, at.O_V] ** 2
    assert 0.060 * x[-1] == pytest.approx(kinetic + stored + lost, rel=5e-3)


def _tension(u: Floats) -> Floats:
    capsule = Capsule()
    return np.asarray(
        wall_tension(u, WallConstants.from_set(), wall_section(capsule, Tissue()), stretched_length(capsule))
    )


def _resistance(v: Floats) -> Floats:
    return environmental_resistance(np.abs(v), Capsule(), Tissue())


def test_a_blocked_coil_follows_its_time_constant() -> None:
    """`i = U/R (1 - exp(-R t/L))`, held at the limit; the capsule rests below break-away."""
    coil = TrueCoil(
        gain_N_per_A=0.02, resistance_ohm=10.0, inductance_H=0.05, current_limit_A=0.3, back_emf_V_s_per_m=1.0
    )
    rows = Plant(Truth(coil)).advance(np.full(2001, 5.0))
    t, current = rows[1:, at.O_T], rows[:-1, at.O_CURRENT]
    exact = np.minimum(0.5 * (1 - np.exp(-t / 5e-3)), 0.3)
    assert current == pytest.approx(exact, abs=2e-3)
    assert rows[-1, at.O_CURRENT] == 0.3
    assert not rows[:, at.O_X].any()


def test_a_stiff_link_pulls_like_an_imposed_position() -> None:
    drive = 5e-3 * STEP_S * np.arange(50_001)
    stiff, imposed = (Plant(Truth(TruePull(k, 2.0 if k else 0.0))).advance(drive) for k in (5e4, 0.0))
    later = stiff[:, at.O_T] > 0.05
    assert np.mean(stiff[later, at.O_FORCE]) == pytest.approx(np.mean(imposed[later, at.O_FORCE]), rel=1e-2)
