"""The control model against the assembled one, its derivatives, its compiled twin, and what it takes."""

import itertools
import tomllib
from typing import Any

import numpy as np
import pytest

from controller.model.control_model import ControlModel, control_model
from models.assembly.model import assemble
from models.identification.model import HELD_OUT
from models.rigs.kinds import drive_of, surface_of
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta
from tests.conftest import RIG
from tests.controller.loops import ticked
from tests.models.running import Array, run

TICK_S = 1e-3
EFFECTS = Theta.of(
    {
        ("actuator_lag", "time_s"): 0.01,
        ("directional_asymmetry", "asymmetry"): 0.2,
        ("sensor_bias", "bias"): 1e-4,
        ("sensor_delay", "delay_s"): 4e-3,
    }
)
PLATE = """
[capsule]
mass_kg = 0.02
[drive]
inner_mass_kg = 0.01
spring_stiffness_N_per_m = 150.0
force_N = 0.5
reaction_on_body = true
[surface]
kind = "plate"
friction_coefficient = 0.29
[rig]
kind = "vibro"
"""


def rig_of(kind: str) -> Rig:
    raw: dict[str, Any] = tomllib.loads(PLATE if kind == "vibro" else RIG)
    if kind == "coil":
        raw["rig"] = {
            "kind": "coil",
            "force_constant_N_per_A": 0.5,
            "coil_resistance_Ohm": 10.0,
            "coil_inductance_H": 0.05,
        }
    return parse_rig(raw)


@pytest.fixture(scope="module")
def magnetic() -> ControlModel:
    return control_model(rig_of("magnetic"), Theta(), TICK_S)


def path(model: ControlModel, command: Array) -> Array:
    """Positions, one a tick, by CasADi's own machine."""
    chain = model.step.mapaccum(command.size)
    states = chain(
        model.initial(), command[None, :], np.zeros((1, command.size)), TICK_S * np.arange(command.size)[None, :]
    )
    return np.asarray(np.array(states)[0])


def test_it_follows_the_exact_stick_and_slip_ever_closer_with_less_smoothing() -> None:
    """A carriage at 8 mm/s for 0.6 s: some teeth of the saw, the assembled model at 20 us without smoothing as the
    reference.
    """
    rig, seconds, fine = rig_of("magnetic"), 0.6, 2e-5
    times = np.arange(0.0, seconds, fine)
    exact = run(assemble(surface_of(rig), drive_of(rig)), 8e-3 * times, fine)
    errors = []
    for smoothing in (2e-4, 5e-5, 1e-5):
        model = control_model(rig, Theta(), TICK_S, smoothing)
        x = path(model, 8e-3 * TICK_S * (np.arange(round(seconds / TICK_S) - 1) + 0.5))
        errors.append(float(np.sqrt(np.mean((x - np.interp(TICK_S * np.arange(1, x.size + 1), times, exact)) ** 2))))
    assert errors[0] > errors[1] > errors[2]
    assert errors[1] < 0.1e-3
    assert errors[2] < 0.05e-3


def test_states_are_cut_to_what_matters() -> None:
    assert control_model(rig_of("magnetic"), Theta(), TICK_S).states == ("x", "v", "u", "slip")
    rich = control_model(rig_of("magnetic"), EFFECTS | {("preconditioning", "fall"): 0.2}, TICK_S)
    assert rich.states == ("x", "v", "u", "slip", "direction", "travelled", ("actuator_lag", "command"))
    assert rich.modes == ("slip", "direction")
    assert control_model(rig_of("coil"), Theta(), TICK_S, driven="coil_voltage_V").states == (
        "x",
        "v",
        "u",
        "slip",
        ("coil", "current_A"),
    )
    assert control_model(rig_of("vibro"), Theta(), TICK_S).states == (
        "x",
        "v",
        ("vibro", "stretch_m"),
        ("vibro", "rate_m_s"),
    )


@pytest.mark.parametrize("kind", ["coil", "vibro"])
def test_a_model_of_records_of_a_voltage_leads_a_drive_that_is_commanded_otherwise(kind: str) -> None:
    """What the records say of the friction is kept; resistance and back-EMF are the current's own loop's."""
    fitted = {"friction_coefficient": 0.11}
    coil = {"coil_force_N_per_A": 0.47, "coil_resistance_ohm": 10.6, "back_emf_V_s_per_m": 0.4}
    numbers = Theta(fitted | coil)
    assert control_model(rig_of(kind), numbers, TICK_S).theta["friction_coefficient"] == 0.11
    if kind == "coil":
        behind = control_model(rig_of(kind), numbers, TICK_S, driven="coil_voltage_V")
        assert behind.theta.base.items() >= coil.items()


@pytest.mark.parametrize("kind", ["magnetic", "coil", "vibro"])
@pytest.mark.parametrize("speed", [0.0, 3e-3, -3e-3])
def test_jacobians_are_the_slopes_of_the_step(kind: str, speed: float) -> None:
    model = control_model(rig_of(kind), Theta(), TICK_S)
    x, command, scale = (
        model.initial(),
        {"magnetic": 2e-3, "coil": 0.08, "vibro": 0.4}[kind],
        np.ones(len(model.states) + 2),
    )
    x[1] = speed
    free = [k for k, name in enumerate(model.states) if name not in model.modes]

    def moved(delta: Array) -> Array:
        return np.array(model.step(x + delta[:-2], command + delta[-2], delta[-1], 0.0)).ravel()

    slopes = np.hstack([np.array(e) for e in model.jacobians(x, command, 0.0, 0.0)[1:]])
    for k in [*free, -2, -1]:
        step = np.zeros(scale.size)
        step[k] = 1e-8
        difference = (moved(step) - moved(-step)) / 2e-8
        assert slopes[:, k] == pytest.approx(difference, rel=2e-3, abs=1e-6)


def test_the_compiled_step_is_the_same_step(magnetic: ControlModel) -> None:
    kernels, x, y = magnetic.kernels, magnetic.initial(), magnetic.initial()
    for k in range(600):
        x = ticked(kernels, x, 8e-3 * k * TICK_S, 1e-3, k * TICK_S)
        y = np.array(magnetic.step(y, 8e-3 * k * TICK_S, 1e-3, k * TICK_S)).ravel()
    assert x[0] > 1e-3
    assert x == pytest.approx(y, rel=1e-9, abs=1e-12)
    states = np.array([x, y])
    kernels.run(states, 2e-3, 2e-3, np.array([1e-3, 0.0]), 0.0, TICK_S, kernels.substeps, kernels.parameters)
    assert states[0] == pytest.approx(np.array(magnetic.step(x, 2e-3, 1e-3, 0.0)).ravel())
    assert states[1] == pytest.approx(np.array(magnetic.step(y, 2e-3, 0.0, 0.0)).ravel())


def test_stages_and_their_slopes_agree_with_differences(magnetic: ControlModel) -> None:
    """Through a slip of the wall: the slopes see how its instant moves."""
    kernels, n, count = magnetic.kernels, len(magnetic.states), 6
    commands = np.linspace(4e-3, 6e-3, count + 1)
    path, other = np.zeros((count + 1, n)), np.zeros((count + 1, n))
    path[0] = [0.0, 8e-3, 2.2e-4, 0.0]
    A, B = np.zeros((count, n, n)), np.zeros((count, n, 2))
    arguments = (0.0, 0.0, 5e-3, 5, kernels.parameters)
    kernels.linearise(path, A, B, commands, arguments)
    assert path[-1, magnetic.index("slip")] == 1.0
    for delta in (np.array([1e-8, 0, 0, 0]), np.array([0, 1e-8, 0, 0]), np.array([0, 0, 1e-8, 0])):
        other[0] = path[0] + delta
        kernels.roll(other, commands, arguments)
        expected = delta
        for k in range(count):
            expected = A[k] @ expected
        assert (other[-1] - path[-1])[:3] == pytest.approx(expected[:3], rel=0.02, abs=1e-11)
    other[0] = path[0]
    kernels.roll(other, commands + 1e-8 * np.eye(count + 1)[1], arguments)
    change = B[0, :, 1] * 1e-8
    change = A[1] @ change + B[1, :, 0] * 1e-8
    assert (other[2] - path[2])[:3] == pytest.approx(change[:3], rel=0.02, abs=1e-11)


def test_the_loops_are_casadis_functions(magnetic: ControlModel) -> None:
    """A path that pursues a line, the wall's force along it, and states that each have their own friction."""
    kernels, count, p = magnetic.kernels, 12, magnetic.values
    path, slopes = np.zeros((count + 1, len(magnetic.states))), np.zeros((count + 1, len(magnetic.states)))
    path[0] = [0.0, 8e-3, 2.2e-4, 0.0]
    commands, forces = np.full(count + 1, 4e-3), np.zeros(count + 1)
    line = np.linspace(0.0, 1e-3, count + 1)
    wanted, motion = np.array([line, 0 * line + 0.02]), (1e-3, 0.0, 5e-3, 2, p)
    kernels.pursue(path, commands, wanted, (0.03, 0.25, -1.0, 1.0), motion)
    again = path.copy()
    kernels.roll(again, commands, motion)
    assert np.array_equal(again, path)
    kernels.holds(path, forces, slopes, 0.0, 5e-3, p)
    for k in range(count):
        wanted = magnetic.symbols.pursuit(path[k], 0.02 + (line[k + 1] - path[k, 0]) / 0.03, 1e-3, 5e-3 * k, p)
        assert commands[k + 1] == pytest.approx(np.clip(float(wanted), *(commands[k] + [-1.25e-3, 1.25e-3])), rel=1e-9)
        held, by_state = magnetic.symbols.wall_slopes(path[k], 5e-3 * k, p)
        assert forces[k] == pytest.approx(float(held), rel=1e-9)
        assert slopes[k] == pytest.approx(np.array(by_state).ravel(), rel=1e-9)
    each = np.array(path[:3])
    own = p[0] * np.array([0.9, 1.0, 1.1])
    kernels.run_each(np.array([0]), own[None, :], each, 5e-3, 5.1e-3, np.zeros(3), 0.0, TICK_S, 1, p)
    for before, after, friction in zip(path, each, own, strict=False):
        numbers = np.array([friction, *p[1:]])
        expected = magnetic.symbols.substep(before, 5e-3, 5.1e-3, 0.0, 0.0, TICK_S, numbers)
        assert after == pytest.approx(np.array(expected).ravel(), rel=1e-9, abs=1e-12)


def test_a_disturbance_is_a_force_along_x(magnetic: ControlModel) -> None:
    """Far above the wall's grip it moves the capsule as the magnet with the same force does."""
    force = 0.4
    gap = next(g for g in np.linspace(0, 0.0115, 100000) if 25 * g / (1 + (g / 0.02) ** 2) ** 2 >= 0.15)
    by_force = magnetic.step(magnetic.initial(), 0.0, 0.15, 0.0)
    by_magnet = magnetic.step(magnetic.initial(), gap, 0.0, 0.0)
    assert np.array(by_force).ravel()[1] == pytest.approx(np.array(by_magnet).ravel()[1], rel=2e-2)
    assert np.array(magnetic.step(magnetic.initial(), 0.0, -force, 0.0)).ravel()[1] < 0


def test_the_sensor_is_not_the_motion() -> None:
    model = control_model(rig_of("magnetic"), EFFECTS, TICK_S)
    assert model.delay_s == pytest.approx(4e-3)
    assert float(model.measured(model.initial(2e-3), 0.0)) == pytest.approx(2.1e-3)
    smooth = control_model(rig_of("magnetic"), Theta.of({("sensor_lowpass", "time_s"): 0.05}), TICK_S)
    assert float(smooth.measured(smooth.initial(2e-3), 0.0)) == pytest.approx(2e-3)


def test_the_wall_holds_what_the_law_says(magnetic: ControlModel) -> None:
    """At 10 mm/s on a wall not yet dragged: F_e = 66.37 mN, the check value of physics.md."""
    x = magnetic.initial()
    x[1] = 10e-3
    assert float(magnetic.symbols.wall_force(x, 0.0, magnetic.values)) == pytest.approx(66.37e-3, rel=0.01)
    assert magnetic.drive.gap_limit_m == pytest.approx(0.02 / np.sqrt(3))


@pytest.mark.parametrize(("regime", "force_N"), [("low", 98.99e-3), ("blend", 125.49e-3), ("high", 125.49e-3)])
def test_above_20_mm_s_the_regime_of_the_rig_file_holds(regime: str, force_N: float) -> None:
    """At 60 mm/s: F_e = 125.49 mN with paper V's high-speed moduli, the check value of physics.md."""
    fast = control_model(
        parse_rig(tomllib.loads(RIG.replace("[tissue]", f'[tissue]\nregime = "{regime}"'))), {}, TICK_S
    )
    x = fast.initial()
    x[1] = 60e-3
    assert float(fast.symbols.wall_force(x, 0.0, fast.values)) == pytest.approx(force_N, rel=0.01)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"magnet_stifness_N_per_m": 25.0}, "magnet_stiffness_N_per_m"),
        ({("stribek", "excess"): 1.0}, "stribeck"),
        (Theta.of({("string_compliance", "compliance_m_per_N"): 1e-3}), "must name effects of a magnetic rig"),
        ({"friction_coefficient": float("nan")}, "finite"),
    ],
)
def test_values_that_do_not_fit_are_refused(values: dict[str, float], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        control_model(rig_of("magnetic"), values, TICK_S)


def test_a_free_curve_over_speed_is_left_out_and_with_it_what_its_model_proved() -> None:
    """It zigzags from knot to knot, and an inverse would follow it."""
    named = Theta.of(
        {
            ("directional_asymmetry", "asymmetry"): 0.2,
            ("level_at_creep", "odd"): 0.2,
            ("level_at_creep", "even"): 0.1,
            HELD_OUT: 1e-5,
        }
    )
    curve = {("level_over_speed", f"{side}_{k}"): 0.08 * (-1) ** k for side in ("even", "odd") for k in range(1, 9)}
    corrected, plain = (control_model(rig_of("magnetic"), values, TICK_S) for values in (named | curve, named))
    assert [p.key for p in corrected.symbols.parameters] == [p.key for p in plain.symbols.parameters]
    assert plain.held_out_error == 1e-5
    assert corrected.held_out_error is None


def test_a_carriage_takes_its_play_along() -> None:
    """A soft seat follows as the carriage goes: in one tick or two, in a straight line or by a jump, as far."""
    model = control_model(
        rig_of("magnetic"),
        Theta.of({("carriage_backlash", "play_m"): 2e-3, ("carriage_backlash", "sharpness"): 1.0}),
        TICK_S,
    )
    seat, ways = model.index(("carriage_backlash", "position_m")), []
    for commands, seconds in (((0.0, 0.8e-3), 2e-3), ((0.0, 0.4e-3, 0.8e-3), 1e-3), ((0.0, 0.8e-3), 1e-7)):
        states = model.initial().reshape(1, -1)
        for before, after in itertools.pairwise(commands):
            model.kernels.run(states, before, after, np.zeros(1), 0.0, seconds, 8, model.values)
        ways.append(states[0, seat])
    assert 0.2e-3 < ways[0] < 0.8e-3
    assert ways == pytest.approx([ways[0]] * 3, rel=0.02)


def test_a_pull_cannot_be_controlled() -> None:
    raw = tomllib.loads(RIG)
    raw["rig"] = {"kind": "pull"}
    with pytest.raises(ValueError, match="capsule is free"):
        control_model(parse_rig(raw), Theta(), TICK_S)
    with pytest.raises(ValueError, match="tick_s must lie"):
        control_model(rig_of("magnetic"), Theta(), 0.0)
