"""The conformance suite that every effect of the catalogue runs through, on every kind of rig that it declares."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import models.effects
from models.assembly.model import Assembly, assemble
from models.drives.coil import Coil
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import Vibro
from models.effects import BY_ID, EFFECTS, REFINEMENTS, effects_for
from models.effects.effect import Effect, InnerMassEffect, Signals
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall
from tests.models.running import Array, pulses, stepped

PUBLISHED = (
    "stribeck",
    "viscous_drag",
    "directional_asymmetry",
    "fold_periodic",
    "lumen_taper",
    "stenosis",
    "peristaltic_wave",
    "respiration",
    "dwell_adhesion",
    "stress_relaxation",
    "tissue_drying",
    "preconditioning",
    "incline_gravity",
    "added_mass",
    "wall_viscosity",
    "exponential_recovery",
    "string_compliance",
    "coupling_decay",
    "coupling_fade",
    "carriage_backlash",
    "actuator_lag",
    "actuator_dead_zone",
    "actuator_saturation",
    "magnetic_hysteresis",
    "back_emf",
    "spring_damping",
    "end_stop_impact",
    "sensor_drift",
    "sensor_bias",
    "sensor_scale",
    "sensor_delay",
    "sensor_lowpass",
    "mains_hum",
    "small_strain_stiffening",
    "broad_relaxation",
)
OWN = ("coil_lag", "coil_reach", "guide_friction", "spring_hardening")
"""Ids beyond the published ones: the four that a real capsubot's suspension and coil asked for."""
KINDS = ("pull", "magnetic", "coil", "vibro", "vibro_table", "axis", "periods", "dma")
STEP_S = 5e-4
TIME = STEP_S * np.arange(2400)
PAUSED = np.where(TIME < 0.4, TIME, np.maximum(TIME - 0.3, 0.4))  # s, a clock that stops for a while: a rest under way
COMMANDS: dict[str, tuple[Drive, Array]] = {
    "pull": (Pull(), 8e-3 * np.sin(4 * PAUSED) * np.sin(1.5 * PAUSED)),
    "magnetic": (Magnetic(), 12e-3 * np.sin(4 * PAUSED)),
    "coil": (Coil(), 0.3 * np.sin(6 * PAUSED)),
    "vibro": (
        Vibro(0.012, 80.0, force_N=1.0),
        np.where(np.abs(TIME - 0.6) > 0.2, pulses(0.08, 0.4, 15, STEP_S)[: TIME.size], 0.0),
    ),
}
SIGNALS = {
    "t": 0.7,
    "x": 4e-3,
    "v": 6e-3,
    "direction": 1.0,
    "command": 0.4,
    "rate": -0.2,
    "travelled": 0.02,
    "tension": 0.02,
    "drag": 2e-4,
    "drag_rate": 3e-3,
    "dwell": 0.3,
}
MULTIPLIERS = ("level", "stiffening", "gain")
PLAIN = (*MULTIPLIERS, "force", "wall_force", "command")

each_effect = pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
on_each_rig = pytest.mark.parametrize(
    ("effect", "kind"),
    [(e, kind) for e in EFFECTS for kind in COMMANDS if kind in e.kinds],
    ids=lambda x: x if isinstance(x, str) else x.id,
)


@cache
def model(kind: str, effect: str = "", smoothing: float = 0.0) -> Assembly:
    return assemble(Wall.around(Capsule(), Tissue()), COMMANDS[kind][0], [BY_ID[effect]] if effect else [], smoothing)


@cache
def output(kind: str, effect: str = "", amplitude: float = 0.0) -> Array:
    values = {f"{effect}.{BY_ID[effect].amplitude().name}": amplitude} if effect else {}
    return stepped(model(kind, effect), COMMANDS[kind][1], STEP_S, values)


def values_of(effect: type[Effect]) -> dict[str, float]:
    """The parameters at their defaults, the amplitude at its probe."""
    return {p.name: p.value for p in effect.parameters()} | {effect.amplitude().name: effect.probe}


def answers(effect: type[Effect], p: dict[str, Any], z: dict[str, Any], numbers: dict[str, Any]) -> dict[str, Any]:
    """What every hook says."""
    e, s = effect(), Signals(**numbers)
    said = {hook: getattr(e, hook)(s, p, z) for hook in PLAIN}
    said |= {"recovery": e.recovery(s, p, z, 5e-3, 3e-4), "measured": e.measured(s, p, z, 0.03), "delay": e.delay(p)}
    said |= {f"advance.{k}": v for k, v in e.advance(s, p, z, 1e-3).items()}
    said |= {f"follow.{k}": v for k, v in e.follow(s, p, z, 0.03, 1e-3).items()}
    if isinstance(e, InnerMassEffect):
        said |= {"suspension": e.suspension(0.012, 0.1, p), "reach": e.reach(0.012, p)}
    return said


def test_every_file_in_a_folder_of_effects_is_an_effect() -> None:
    files = [path.stem for path in Path(models.effects.__file__).parent.glob("*/*.py") if path.stem != "__init__"]
    assert sorted(e.id for e in (*EFFECTS, *REFINEMENTS)) == sorted(files)
    assert len(BY_ID) == len(EFFECTS) + len(REFINEMENTS)


def test_no_published_id_is_lost() -> None:
    assert {*PUBLISHED, *OWN} - {effect.id for effect in EFFECTS} == set()


@each_effect
def test_it_is_declared(effect: type[Effect]) -> None:
    assert effect.__module__.rpartition(".")[2] == effect.id
    assert effect.id.isidentifier()
    assert effect.id == effect.id.lower()
    assert effect.kinds
    assert effect.kinds <= set(KINDS)
    assert all(effect in effects_for(kind) for kind in effect.kinds)
    assert set(effect.look_alikes) <= set(BY_ID)
    assert effect.id not in effect.look_alikes
    assert all((effect.summary, effect.source, effect.separated_by, effect.__doc__))


@each_effect
def test_its_parameters_are_declared(effect: type[Effect]) -> None:
    names = [p.name for p in effect.parameters()]
    assert len(set(names)) == len(names) > 0
    for p in effect.parameters():
        assert all((p.unit, p.source))
        assert np.isfinite([p.lower, p.upper]).all()
        assert p.lower < p.upper
    amplitude = effect.amplitude()
    assert amplitude.value == 0.0
    assert amplitude.fit
    assert amplitude.lower <= effect.probe <= amplitude.upper
    assert effect.probe != 0
    for name, starts in effect.grid.items():
        p = next(q for q in effect.parameters() if q.name == name)
        assert all(p.lower <= start <= p.upper for start in starts)


@each_effect
def test_its_hooks_say_the_same_to_numpy_and_casadi(effect: type[Effect]) -> None:
    p, z = values_of(effect), dict.fromkeys(effect.states, 0.2)
    plain = answers(effect, p, z, SIGNALS)
    symbols = [{name: ca.SX.sym(name) for name in table} for table in (p, z, SIGNALS)]
    symbolic = answers(effect, *symbols)
    assert plain.keys() == symbolic.keys()
    evaluate = ca.Function(
        "f", [symbol for table in symbols for symbol in table.values()], [ca.SX(value) for value in symbolic.values()]
    )
    got = evaluate.call([value for table in (p, z, SIGNALS) for value in table.values()])
    np.testing.assert_allclose([float(v) for v in got], [float(v) for v in plain.values()], rtol=1e-10, atol=1e-15)
    array = {k: np.full(3, v) for k, v in SIGNALS.items()}
    for name, value in answers(effect, p, z, array).items():
        np.testing.assert_allclose(value, plain[name], rtol=1e-10)


@each_effect
def test_at_amplitude_zero_its_hooks_say_nothing(effect: type[Effect]) -> None:
    p = values_of(effect) | {effect.amplitude().name: 0.0}
    e, s, z = effect(), Signals(**SIGNALS), dict.fromkeys(effect.states, 0.2)
    z = z | e.advance(s, p, z, 1e-3) | e.follow(s, p, z, 0.03, 1e-3)
    assert [getattr(e, hook)(s, p, z) for hook in MULTIPLIERS] == [1.0, 1.0, 1.0]
    assert e.force(s, p, z) == e.wall_force(s, p, z) == e.delay(p) == 0.0
    assert e.command(s, p, z) == pytest.approx(s.command, rel=1e-6)
    assert e.measured(s, p, z, 0.03) == pytest.approx(0.03, rel=1e-12)
    assert e.recovery(s, p, z, 5e-3, 3e-4) == pytest.approx(5e-3, rel=1e-12)
    if isinstance(e, InnerMassEffect):
        assert e.suspension(0.012, 0.1, p) == 0.0
        assert e.reach(0.012, p) == 1.0


@each_effect
def test_its_states_stay_finite_with_steps_of_a_second(effect: type[Effect]) -> None:
    rng = np.random.default_rng(7)
    e, p = effect(), {q.name: q.value for q in effect.parameters()}
    for amplitude in (effect.probe, effect.amplitude().lower, effect.amplitude().upper):
        p[effect.amplitude().name] = amplitude
        z: dict[str, Any] = dict.fromkeys(effect.states, 0.0)
        for k in range(300):
            s = Signals(
                t=float(k), v=rng.normal(0, 0.02), command=rng.normal(), rate=rng.normal(), x=rng.normal(0, 0.02)
            )
            z = z | e.advance(s, p, z, 1.0)
            z = z | e.follow(s, p, z, rng.normal(), 1.0)
        assert all(abs(float(value)) < 10.0 for value in z.values())


@on_each_rig
def test_at_amplitude_zero_the_model_is_the_base_model(effect: type[Effect], kind: str) -> None:
    base, off = output(kind), output(kind, effect.id)
    if (
        effect.id == "string_compliance"
    ):  # a mass behind a nearly rigid link: the same but for its inertia where the speed jumps
        assert np.median(np.abs(off - base)) < 2e-3 * np.ptp(base)
    else:
        np.testing.assert_allclose(off, base, rtol=0, atol=5e-6 * np.ptp(base))


@on_each_rig
def test_its_probe_shows_in_the_output(effect: type[Effect], kind: str) -> None:
    on = output(kind, effect.id, effect.probe)
    assert np.isfinite(on).all()
    delay = float(effect().delay(values_of(effect)))
    moved = np.interp(TIME - delay, TIME, on)
    assert np.max(np.abs(moved - output(kind))) > 1e-5 * np.ptp(output(kind))


@on_each_rig
def test_a_smooth_model_with_it_has_finite_derivatives(effect: type[Effect], kind: str) -> None:
    assembly = model(kind, effect.id, 1e-4)
    slopes = jacobians(assembly)
    q = assembly.vector({f"{effect.id}.{effect.amplitude().name}": effect.probe})
    state = assembly.start()
    for k, (c0, c1) in enumerate([(0.0, 0.0), (0.0, 0.0), (0.0, 1e-5), (1e-5, 2e-5)]):
        assert all(np.isfinite(np.array(j)).all() for j in slopes(state, c0, c1, k * STEP_S, STEP_S, q))
        state = np.array(assembly.step(state, c0, c1, k * STEP_S, STEP_S, q)[0]).ravel()


def jacobians(assembly: Assembly) -> ca.Function:
    """Derivatives of state and output with respect to state, commands and parameters."""
    symbols = assembly.step.sx_in()
    both = ca.vertcat(*assembly.step(*symbols))
    return ca.Function("slopes", symbols, [ca.jacobian(both, symbols[k]) for k in (0, 1, 2, 5)])
