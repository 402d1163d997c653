"""Two programs for one physics: the symbolic model against the plant with its exact set-valued friction."""

import numpy as np
import pytest

from models.assembly.model import assemble
from models.drives.coil import VoltageCoil, Winding
from models.drives.magnetic import Magnetic, MagnetPair
from models.drives.pull import Pull
from models.drives.vibro import Stop, Vibro, VoltageVibro
from models.laws.geometry import Capsule, Regime, Tissue
from models.surfaces.gut import Wall
from models.surfaces.surface import Plate
from plant import layout as at
from plant.drives import TrueCoil, TrueMagnet, TrueMagnetPair, TruePull, TrueVibro
from plant.rig import Plant, TruePlate, Truth
from plant.tables import resistance
from tests.models.running import Array, pulses, run

STEP_S = 20e-6
P = {"hoop_stress_factor": 1.0, "friction_coefficient": 0.082}
BODY = Capsule(mass_kg=0.02)
WINDING, COIL = Winding(10.0, 0.05, 1.0, 0.5), TrueCoil(0.5, 10.0, 0.05, 1.0, 0.5)


def plant_path(rig: Truth, drive: Array) -> Array:
    return np.asarray(Plant(rig).advance(drive)[:, at.O_X])


@pytest.mark.parametrize("speed_m_s", [4e-3, 8e-3])
def test_the_smooth_model_converges_to_the_plant_with_order_one(speed_m_s: float) -> None:
    """Carriage at constant speed, fine steps: halving the smoothing halves the distance (measured order 0.76 rising to
    0.95).

    It stays a little below one because creep towards break-away adds a logarithm, and beyond a few teeth the error of a
    slip's instant adds up, so smoothing helps less in long runs and around reversals (order about a half there).
    """
    h = 5e-6
    carriage = speed_m_s * np.arange(0.0, 1.5, h)
    exact = plant_path(Truth(TrueMagnet(25.0, 0.02), step_s=h), carriage)
    wall, errors = Wall.around(Capsule(), Tissue()), []
    smoothings = (1e-5, 5e-6, 2.5e-6)
    for smoothing in smoothings:
        x = run(assemble(wall, Magnetic(25.0, 0.02), smoothing=smoothing), carriage, h)[: exact.size]
        errors.append(float(np.sqrt(np.mean((x - exact) ** 2))))
    orders = np.diff(np.log(errors)) / np.diff(np.log(smoothings))
    assert np.all((orders > 0.85) & (orders < 1.1)), orders
    sharp = run(assemble(wall, Magnetic(25.0, 0.02)), carriage, h)[: exact.size]
    assert np.sqrt(np.mean((sharp - exact) ** 2)) < 0.3 * errors[-1]


@pytest.mark.parametrize(("regime", "force_N"), [("low", 98.99e-3), ("blend", 125.49e-3)])
def test_model_and_plant_take_the_regime_of_the_tissue(regime: Regime, force_N: float) -> None:
    """At 60 mm/s paper V's high-speed moduli give 125 mN where its low-speed ones give 99."""
    tissue = Tissue(regime=regime)
    assert resistance(Plant(Truth(TrueMagnet(25.0, 0.02), tissue=tissue)).tables, 60e-3) == pytest.approx(
        force_N, rel=2e-4
    )
    assert Wall.around(Capsule(), tissue).hold(60e-3, P)[0] == pytest.approx(force_N, rel=2e-4)


def test_a_wall_that_the_capsule_overtakes_stays_stuck_above_its_slip_limit() -> None:
    """Torn off at 20 mm/s, T = f_c(20) = 47.5 mN, and pushed back at 10 mm/s, where f_c = 41.7 mN and v_i = 5.7 mm/s:
    it sticks at once and goes with the capsule. At 1 mm/s it is not overtaken, and slips on.
    """
    wall = Wall.around(Capsule(), Tissue())
    torn = int(wall.drag_at(wall.hold(20e-3, P)[1]) / (20e-3 * STEP_S)) + 5
    for back, stuck in ((10e-3, True), (1e-3, False)):
        place = np.concatenate([[0.0], np.cumsum(np.repeat([20e-3, -back], [torn, 200]) * STEP_S)])
        u = Plant(Truth(TruePull())).advance(np.append(place, place[-1]))[:, at.O_U]
        limit = wall.hold(back, P)[1]
        assert wall.tension(u[torn + 25]) > 1.02 * limit
        rate = -back if stuck else -wall.drag_at(limit) / 0.05
        assert np.diff(u[torn + 2 : torn + 25]) / STEP_S == pytest.approx(rate, rel=1e-3)
        model = run(assemble(wall, Pull()), place, STEP_S, watch="u")
        assert np.max(np.abs(model[: u.size] - u)) < 1e-6


@pytest.mark.parametrize("on_plate", [False, True])
@pytest.mark.parametrize("along", [False, True])
def test_a_pair_of_magnets_pulls_and_presses_as_in_the_plant(along: bool, on_plate: bool) -> None:
    """Closed forms of the pull against the vectors of two dipoles; the attraction adds to the friction, so that the
    capsule stays behind by more than the pull alone tells.
    """
    t = np.arange(0.0, 3.0, STEP_S)
    carriage = 0.03 * np.sin(2 * t)
    pair = TrueMagnetPair(400.0, 1.0, 0.1, along)
    rows = Plant(Truth(pair, surface=TruePlate(0.2) if on_plate else None)).advance(carriage)
    k = float(pair.forces(np.array([1e-5]))[0][0]) / 1e-5
    drive = MagnetPair(k, height_m=0.1, orientation="along" if along else "across")
    surface = Plate(4e-3, 0.2) if on_plate else Wall.around(Capsule(), Tissue())
    x = run(assemble(surface, drive), carriage, STEP_S)[: rows.shape[0]]
    assert np.max(np.abs(x - rows[:, at.O_X])) < 5e-3 * np.ptp(rows[:, at.O_X])
    unpressed = run(assemble(surface, Magnetic(k, drive.gap_limit_m * 3**0.5)), carriage, STEP_S)[: rows.shape[0]]
    lag, free = (np.sqrt(np.mean((carriage[: x.size] - path) ** 2)) for path in (x, unpressed))
    assert lag > 1.2 * free


@pytest.mark.parametrize("stops", [False, True])
@pytest.mark.parametrize("reaction", [False, True])
def test_vibro_on_a_plate_moves_like_the_plant(reaction: bool, stops: bool) -> None:
    on, gaps = pulses(0.05, 0.4, 40, STEP_S), (2e-3, 3000.0, 1.5e-3, 3000.0) if stops else ()
    exact = plant_path(
        Truth(TrueVibro(0.01, 150.0, 0.05, 0.5, reaction, *gaps), capsule=BODY, surface=TruePlate(0.29)), 0.5 * on
    )
    walls = (Stop(2e-3, 3000.0), Stop(1.5e-3, 3000.0)) if stops else (None, None)
    x = run(assemble(Plate(0.02, 0.29), Vibro(0.01, 150.0, 0.05, 0.5, reaction, *walls)), on, STEP_S)[: exact.size]
    assert np.max(np.abs(x - exact)) < 5e-3 * np.ptp(exact)


@pytest.mark.parametrize(("force_N", "period_s"), [(0.35, 0.05), (0.5, 0.03), (0.5, 0.047)])
def test_vibro_in_the_gut_moves_like_the_plant(force_N: float, period_s: float) -> None:
    """The last one is shaken at its spring's resonance, to and fro at 0.47 m/s."""
    h = 1.25e-6  # the plant places a slip at a step's end
    on = pulses(period_s, 0.4, 40, h)
    exact = plant_path(Truth(TrueVibro(0.01, 150.0, 0.05, force_N), capsule=BODY, step_s=h), force_N * on)
    x = run(assemble(Wall.around(BODY, Tissue()), Vibro(0.01, 150.0, 0.05, force_N)), on, h)[: exact.size]
    assert np.max(np.abs(x - exact)) < 5e-3 * np.ptp(exact)


def test_a_voltage_driven_coil_in_the_gut_moves_like_the_plant() -> None:
    t = np.arange(0.0, 6.0, STEP_S)
    voltage = 4 * np.sin(3 * t)
    rows = Plant(Truth(COIL)).advance(voltage)
    model = assemble(Wall.around(Capsule(), Tissue()), VoltageCoil(0.5, winding=WINDING))
    exact, n = rows[:, at.O_X], rows.shape[0]
    assert np.ptp(exact) > 0.03
    assert np.max(np.abs(run(model, voltage, STEP_S)[:n] - exact)) < 1e-2 * np.ptp(exact)
    current = run(model, voltage, STEP_S, watch=("coil", "current_A"))[: n - 1]
    assert np.sqrt(np.mean((current - rows[1:, at.O_CURRENT]) ** 2)) < 1e-3


def test_a_voltage_driven_inner_mass_moves_like_the_plant() -> None:
    voltage = 8.0 * pulses(0.05, 0.4, 40, STEP_S)
    exact = plant_path(Truth(TrueVibro(0.01, 150.0, 0.05, coil=COIL), capsule=BODY, surface=TruePlate(0.29)), voltage)
    drive = VoltageVibro(0.01, 150.0, 0.05, coil_force_N_per_A=0.5, winding=WINDING)
    x = run(assemble(Plate(0.02, 0.29), drive), voltage, STEP_S)[: exact.size]
    assert np.max(np.abs(x - exact)) < 5e-3 * np.ptp(exact)
