"""The conformance suite that every effect of the catalogue runs through, on every kind of rig that it declares."""

import re
from dataclasses import fields
from functools import cache
from inspect import signature
from pathlib import Path

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
from models.effects import CATALOGUE, EFFECTS, REFINEMENTS, effect_words
from models.effects.conformance import CHECKS, values_of
from models.effects.declarations import DECLARATIONS
from models.effects.drive import ActuatorLag
from models.effects.effect import HOOKS, Effect, Forms, Signals, Values
from models.files.toml import beside
from models.formula import Formula, equal
from models.laws.geometry import Capsule, Tissue
from models.parameter import Parameter
from models.rigs.kinds import KINDS
from models.surfaces.gut import Wall
from models.theta import Theta
from tests.models.running import Array, pulses, stepped
from tests.places import ROOT

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

each_effect = pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.id)
on_each_rig = pytest.mark.parametrize(
    ("effect", "kind"),
    [(e, kind) for e in EFFECTS for kind in COMMANDS if kind in e.kinds],
    ids=lambda x: x if isinstance(x, str) else x.id,
)


@cache
def model(kind: str, effect: str = "", smoothing: float = 0.0) -> Assembly:
    return assemble(
        Wall.around(Capsule(), Tissue()), COMMANDS[kind][0], [CATALOGUE[effect]] if effect else [], smoothing
    )


@cache
def output(kind: str, effect: str = "", amplitude: float = 0.0) -> Array:
    values = Theta.of({(effect, CATALOGUE[effect].amplitude().name): amplitude}) if effect else {}
    return stepped(model(kind, effect), COMMANDS[kind][1], STEP_S, values)


def test_every_effect_that_a_file_of_the_room_declares_is_in_the_catalogue() -> None:
    written = "".join(path.read_text() for path in Path(models.effects.__file__).parent.glob("*.py"))
    assert sorted(e.id for e in (*EFFECTS, *REFINEMENTS)) == sorted(re.findall(r'^    id = "(\w+)"$', written, re.M))
    assert len(CATALOGUE) == len(EFFECTS) + len(REFINEMENTS)


def test_every_effect_has_a_name_in_words() -> None:
    words = [effect_words(name) for name in CATALOGUE]
    assert len(set(words)) == len(words)
    assert all("_" not in one and one != name.replace("_", " ") for one, name in zip(words, CATALOGUE, strict=True))
    assert effect_words("my_effect") == "my effect"


def test_no_published_id_is_lost() -> None:
    assert {*PUBLISHED, *OWN} - {effect.id for effect in EFFECTS} == set()


@each_effect
def test_it_is_declared(effect: type[Effect]) -> None:
    assert effect.id.isidentifier()
    assert effect.id == effect.id.lower()
    assert effect.kinds
    assert effect.kinds <= {*KINDS, "driven_axis"}
    assert all(effect in CATALOGUE.acting_on(kind) for kind in effect.kinds)
    assert set(effect.confounders) <= set(CATALOGUE)
    assert effect.id not in effect.confounders
    assert all((effect.summary, effect.source, effect.separated_by, effect.__doc__))


def test_the_words_of_ours_are_those_of_an_effect() -> None:
    assert beside(models.effects.__file__, "effects.toml").keys() <= CATALOGUE.keys()


@each_effect
def test_its_parameters_are_declared(effect: type[Effect]) -> None:
    names = [p.name for p in effect.parameters()]
    assert len(set(names)) == len(names) > 0
    for p in effect.parameters():
        assert all((p.unit, p.source, p.symbol))
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
@pytest.mark.parametrize("check", CHECKS)
def test_it_conforms(effect: type[Effect], check: str) -> None:
    """What `capsule effects check` asks of a user's effect."""
    assert not list(CHECKS[check](effect, set(CATALOGUE)))


@pytest.mark.parametrize("effect", REFINEMENTS, ids=lambda e: e.id)
def test_a_refinement_computes_what_its_equations_say(effect: type[Effect]) -> None:
    assert not list(CHECKS["equations"](effect, set(CATALOGUE)))


def test_an_equation_that_an_effect_states_must_be_what_its_hooks_compute() -> None:
    class Wrong(ActuatorLag):
        @classmethod
        def forms(cls, s: Signals, p: Values, z: Values) -> Forms:
            return {"command": [equal(2 * p["time_s"] * Formula("u'"), s.command - z["command"])]}

    assert any("must be what its hooks compute" in failure for failure in CHECKS["equations"](Wrong, set(CATALOGUE)))


def test_contributing_names_every_hook_and_declaration() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    told = set(re.findall(r"[a-z_]+", " ".join(re.findall(r"`([^`\n]+)`", text)), re.IGNORECASE))
    assert {*HOOKS, *DECLARATIONS, *(f.name for f in fields(Parameter))} - told == set()
    for hook, base in HOOKS.items():
        assert f"| `{hook}({', '.join(list(signature(base).parameters)[1:])})` |" in text


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
    q = assembly.vector(Theta.of({(effect.id, effect.amplitude().name): effect.probe}))
    state = assembly.start()
    for k, (c0, c1) in enumerate([(0.0, 0.0), (0.0, 0.0), (0.0, 1e-5), (1e-5, 2e-5)]):
        assert all(np.isfinite(np.array(j)).all() for j in slopes(state, c0, c1, k * STEP_S, STEP_S, q))
        state = np.array(assembly.step(state, c0, c1, k * STEP_S, STEP_S, q)[0]).ravel()


def jacobians(assembly: Assembly) -> ca.Function:
    """Derivatives of state and output with respect to state, commands and parameters."""
    symbols = assembly.step.sx_in()
    both = ca.vertcat(*assembly.step(*symbols))
    return ca.Function("slopes", symbols, [ca.jacobian(both, symbols[k]) for k in (0, 1, 2, 5)])
