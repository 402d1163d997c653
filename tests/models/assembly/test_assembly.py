"""The assembled model against trajectories of a separate implementation and against answers known in closed form."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt

from models.assembly.model import BASE_STATES, assemble
from models.compiled.kernel import Kernel
from models.drives.coil import Coil, VoltageCoil, Winding
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import RatedVibro, Stop, Vibro
from models.effects.friction import DirectionalAsymmetry
from models.laws.geometry import GRAVITY, Capsule, Tissue
from models.rigs.kinds import drive_of, surface_of
from models.rigs.reader import parse_rig
from models.surfaces.gut import Wall
from models.surfaces.surface import Plate
from models.theta import Theta
from tests.models.running import Array, pulses, run

BIG = (Plate(0.193, 0.29), Vibro(0.074, 256.23, force_N=1.25))
SMALL = (Plate(0.0213, 0.7 / (0.0444 * GRAVITY)), Vibro(0.0231, 360.0, force_N=0.8))
STEPS = 600  # steps a period, about 0.1 ms


@cache
def gut() -> Wall:
    return Wall.around(Capsule(), Tissue())


def low_passed(y: Array, rate_Hz: float = 1000.0) -> Array:
    b, a = butter(2, 2.0, fs=rate_Hz)
    return np.asarray(filtfilt(b, a, y))


def columns(path: Path) -> dict[str, Array]:
    data = np.genfromtxt(path, delimiter=",", names=True)
    return {name: data[name] for name in data.dtype.names or ()}


def steady_speed(surface: Plate, drive: Vibro, period_s: float, duty: float, steps: int = STEPS) -> float:
    """Mean speed over 100 periods after 100 periods."""
    x = run(assemble(surface, drive), pulses(period_s, duty, 200, period_s / steps), period_s / steps)
    return float(x[200 * steps] - x[100 * steps]) / (100 * period_s)


def test_pull_follows_the_reference(shared: Path) -> None:
    reference = columns(shared / "reference" / "pull.csv")
    force = run(assemble(gut(), Pull()), reference["position_m"], 1e-3)
    assert np.max(np.abs(low_passed(force - reference["force_N"]))) < 0.6e-3
    assert np.median(np.abs(force - reference["force_N"])) < 0.1e-3


def test_magnetic_follows_the_reference(shared: Path) -> None:
    reference = columns(shared / "reference" / "magnetic.csv")
    t = reference["t_s"]
    carriage = CubicSpline(t, reference["carriage_position_m"])(np.arange(4 * t.size - 3) * 0.25e-3)
    error = run(assemble(gut(), Magnetic(25.0, 0.02)), carriage, 0.25e-3)[::4] - reference["position_m"]
    assert np.max(np.abs(low_passed(error))) < 20e-6
    assert np.sqrt(np.mean(error**2)) < 12e-6


def test_constant_speed_gives_the_reference_saw_tooth(shared: Path) -> None:
    reference = columns(shared / "reference" / "constant_speed.csv")
    model = assemble(gut(), Pull())
    for k, speed in enumerate(reference["speed_m_s"]):
        period = reference["period_s"][k]
        dt = min(2e-4, period / 200)
        t = np.arange(0.0, 12 * period + 0.3, dt)
        force, u = run(model, speed * t, dt), run(model, speed * t, dt, watch="u")
        peaks = 1 + np.flatnonzero((u[1:-1] > u[:-2]) & (u[1:-1] >= u[2:]) & (t[1:-1] > 0.3))
        whole = force[peaks[0] : peaks[-1]]
        assert np.mean(np.diff(t[peaks])) == pytest.approx(period, rel=1e-2)
        assert np.min(whole) == pytest.approx(reference["valley_force_N"][k], rel=1e-2)
        assert np.max(whole) == pytest.approx(reference["peak_force_N"][k], rel=1e-2)
        assert np.mean(whole) == pytest.approx(reference["mean_force_N"][k], rel=1e-2)


@pytest.mark.parametrize(
    ("rig", "period_s", "duty", "speed_m_s"),
    [(BIG, 0.060, 0.3, -8.275e-3), (BIG, 0.097, 0.14, 19.625e-3), (SMALL, 0.0441, 0.785, -75.85e-3)],
)
def test_capsubot_runs_at_the_exact_solver_s_speed(
    rig: tuple[Plate, Vibro], period_s: float, duty: float, speed_m_s: float
) -> None:
    assert steady_speed(*rig, period_s, duty) == pytest.approx(speed_m_s, rel=2e-3)


def test_capsubot_is_second_order_in_the_step() -> None:
    """Turns, stops and switches lie inside steps; still four times finer steps cut the error by some sixteen."""
    fine = steady_speed(*SMALL, 0.0441, 0.785, 3200)
    coarse, finer = (abs(steady_speed(*SMALL, 0.0441, 0.785, n) - fine) for n in (50, 200))
    assert coarse / finer > 8


@pytest.mark.parametrize(("period_s", "duty"), [(0.06, 0.3), (0.06, 0.45), (0.097, 0.14), (0.05, 0.2)])
def test_capsubot_mirrors_its_duty(period_s: float, duty: float) -> None:
    assert steady_speed(*BIG, period_s, duty) == pytest.approx(-steady_speed(*BIG, period_s, 1 - duty), abs=2e-6)


def test_capsubot_between_stops_runs_at_the_exact_solver_s_speed() -> None:
    stop = Stop(0.012, 800.0)
    drive = Vibro(0.074, 256.23, 1.5, 1.25, True, stop, stop)
    assert steady_speed(BIG[0], drive, 0.06, 0.25) == pytest.approx(-5.4110e-3, rel=2e-3)


@pytest.mark.parametrize(("asymmetry", "speed_m_s"), [(0.2, -13.4575e-3), (-0.2, -3.9939e-3)])
def test_a_resting_body_breaks_away_against_the_friction_of_the_way_it_is_pushed(
    asymmetry: float, speed_m_s: float
) -> None:
    model, dt = assemble(*BIG, [DirectionalAsymmetry]), 0.06 / STEPS
    x = run(model, pulses(0.06, 0.3, 200, dt), dt, values=Theta.of({("directional_asymmetry", "asymmetry"): asymmetry}))
    assert (x[200 * STEPS] - x[100 * STEPS]) / 6.0 == pytest.approx(speed_m_s, rel=2e-3)


def test_an_internal_push_ends_where_momentum_says() -> None:
    """`D = (u - F_k) u t^2/(2 M F_k)`: 6 mm for 20 g, 0.2 N for 20 ms against 50 mN."""
    model = assemble(Plate(0.02, 0.05 / (0.02 * GRAVITY)), Coil(1.0))
    push = np.where(np.arange(48_001) < 4000, 0.2, 0.0)
    assert run(model, push, 5e-6)[-1] == pytest.approx(6.0e-3, abs=6e-6)


@pytest.mark.parametrize("surface", [gut(), Plate(4e-3, 0.29)], ids=["gut", "plate"])
def test_an_hour_below_break_away_moves_exactly_nothing(surface: Wall | Plate) -> None:
    break_away = 42.3e-3 if isinstance(surface, Wall) else 0.29 * 4e-3 * GRAVITY
    held = 0.999 * break_away * np.sin(np.arange(360_001) * 0.01)
    model = assemble(surface, Coil(1.0))
    assert not run(model, held, 0.01).any()
    assert not run(model, held, 0.01, watch="u").any()


def test_energy_of_the_capsubot_balances() -> None:
    """Kinetic and spring energy gained = work of the drive - friction's, over two seconds of sliding and sticking."""
    dt, (surface, drive) = 2e-5, BIG
    on = pulses(0.097, 0.14, 20, dt)
    model = assemble(surface, drive)
    x, v, r, w = (run(model, on, dt, watch=name) for name in ("x", "v", ("vibro", "stretch_m"), ("vibro", "rate_m_s")))
    energy = 0.5 * 0.193 * v**2 + 0.5 * drive.inner_mass_kg * (v + w) ** 2 + 0.5 * drive.spring_stiffness_N_per_m * r**2
    work = np.sum(drive.force_N * on[:-1] * np.diff(r))
    friction = 0.29 * (0.193 + 0.074) * GRAVITY * np.sum(np.abs(np.diff(x)))
    assert energy[-1] - energy[0] == pytest.approx(work - friction, abs=2e-3 * work)


def test_energy_of_a_push_goes_into_wall_and_resistance() -> None:
    """While the wall sticks: work = kinetic + wall + F_e path."""
    dt, model = 2e-5, assemble(gut(), Coil(1.0))
    x, v, slip = (run(model, np.full(2000, 0.060), dt, watch=name) for name in ("x", "v", "slip"))
    assert not slip.any()
    p = {"hoop_stress_factor": 1.0, "friction_coefficient": 0.082}
    tension, resistance = gut().tension(x), gut().hold(np.abs(v), p)[0]
    spent = sum(np.sum(0.5 * (f[1:] + f[:-1]) * np.diff(x)) for f in (tension, resistance))
    assert 0.060 * x[-1] == pytest.approx(0.5 * 4e-3 * v[-1] ** 2 + spent, rel=5e-3)


def test_a_blocked_coil_follows_its_time_constant() -> None:
    """`i = U/R (1 - exp(-R t/L))`, exact whatever the step, held at the limit; the capsule rests below break-away."""
    coil = VoltageCoil(0.02, winding=Winding(10.0, 0.05, 0.3, 1.0))
    model = assemble(gut(), coil)
    for dt in (1e-4, 4e-3):
        current = run(model, np.full(round(0.04 / dt), 5.0), dt, watch=("coil", "current_A"))
        t = dt * np.arange(1, current.size + 1)
        assert current == pytest.approx(np.minimum(0.5 * (1 - np.exp(-t / 5e-3)), 0.3), abs=1e-12)
    assert not run(model, np.full(400, 5.0), 1e-4).any()


def test_a_rated_voltage_is_the_drive_fully_on() -> None:
    on = pulses(0.06, 0.3, 10, 1e-4)
    rated = assemble(BIG[0], RatedVibro(0.074, 256.23, force_N=1.25, rated_voltage_V=24.0))
    np.testing.assert_allclose(run(rated, 24.0 * on, 1e-4), run(assemble(*BIG), on, 1e-4), rtol=1e-9, atol=1e-15)


def test_stiff_stops_stay_stable_with_long_steps() -> None:
    stop = Stop(2e-3, 1e7)
    x = run(
        assemble(BIG[0], Vibro(0.074, 256.23, force_N=1.25, front=stop, rear=stop)), pulses(0.1, 0.5, 100, 5e-3), 5e-3
    )
    assert np.max(np.abs(x)) < 5.0


def test_a_pull_has_no_plate() -> None:
    with pytest.raises(ValueError, match=r"must leave the body free on a plate; got 'pull'"):
        assemble(Plate(0.1), Pull())


@pytest.mark.parametrize("drive", [Pull(), Magnetic(), Coil(), VoltageCoil(), Vibro()], ids=lambda d: type(d).__name__)
def test_an_assembly_declares_what_it_holds(drive: Coil) -> None:
    model = assemble(gut(), drive)
    assert model.states == BASE_STATES + tuple((drive.name, name) for name in drive.states)
    assert set(model.initial) == set(model.states)
    assert all(p.lower <= p.value <= p.upper and p.unit and p.source for p in model.parameters)
    assert len({p.key for p in model.parameters}) == len(model.parameters) == model.step.numel_in(5)
    assert model.vector({"hoop_stress_factor": 1.2})[0] == 1.2
    assert callable(Kernel(model.step, model.correct).many)


def test_rig_files_give_surface_and_drive() -> None:
    body = {
        "capsule": {"mass_kg": 0.193},
        "surface": {"kind": "plate", "friction_coefficient": 0.29},
        "rig": {"kind": "vibro"},
    }
    table = {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 256.23, "force_N": 1.25, "reaction_on_body": True}
    rig = parse_rig({**body, "drive": {**table, "front_stop_gap_m": 0.01, "stop_stiffness_N_per_m": 500.0}})
    assert surface_of(rig) == BIG[0]
    assert drive_of(rig, "drive_on") == Vibro(0.074, 256.23, 0.0, 1.25, True, Stop(0.01, 500.0))
    with pytest.raises(ValueError, match="rated_voltage_V"):
        drive_of(rig, "coil_voltage_V")
