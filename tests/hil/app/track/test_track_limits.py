"""Hard limits hold in the plant behind lags that no model knows and with a base that is off, whatever leads."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.app.scenario.scenario import parse_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.files.toml import read_toml
from models.theta import Theta

GUT = Path(__file__).parents[4] / "hil" / "scenarios" / "track_vibro_gut.toml"
LEADING = {"coil": ("mpc", "pid", "feedforward", "lqr"), "magnetic": ("mpc", "pid", "feedforward", "lqr")}
SINE = {"kind": "sine", "amplitude_mm": 15.0, "frequency_Hz": 0.2}


def broken(raw: dict[str, Any], controller: str, seed: int) -> int:
    """Ticks of the true state beyond a hard limit."""
    scenario = parse_track_scenario(raw)
    trace = run_loop(scenario, believed_model(scenario, Theta()), controller, seed)
    return score(scenario, trace).hard_violations


@pytest.mark.parametrize(("name", "controller"), [("coil_folds", "pid"), ("coil_plate", "pid_friction")])
def test_a_controller_without_a_friction_model_breaks_none(name: str, controller: str) -> None:
    """It knows the place 20 ms late and pushes ever more; the capsule comes loose and was up to 1.3 times too fast."""
    raw, _ = read_toml(GUT.with_name(f"track_{name}.toml"), "scenario")
    assert broken(raw, controller, raw["scenario"]["seed"]) == 0


@pytest.mark.parametrize("controller", LEADING["coil"])
@pytest.mark.parametrize("kind", LEADING)
def test_a_lag_up_to_a_fifth_of_a_second_breaks_none(kind: str, controller: str) -> None:
    rng = np.random.default_rng([len(kind), len(controller)])
    off, drive = rng.uniform(0.85, 1.15, 2), {} if kind == "magnetic" else {"drive": {"gain_N_per_A": 0.5}}
    raw = {
        "scenario": {"duration_s": 6.0},
        "rig": {"kind": kind},
        "tissue": {"preset": "jejunum", "friction_coefficient": 0.082 * off[0], "hoop_stress_factor": off[1]},
        "localisation": {"std": float(rng.uniform(5e-5, 3e-4))},
        "control": {"tick_s": 0.002},
        "reference": SINE,
        "effects": {"actuator_lag": {"time_s": float(rng.uniform(0.02, 0.2))}},
        **drive,
    }
    assert broken(raw, controller, 1) == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_neither_does_an_inner_mass_that_answers_late(seed: int) -> None:
    rng = np.random.default_rng(seed)
    raw, _ = read_toml(GUT, "scenario")
    force, spring = rng.uniform(0.85, 1.15, 2)
    raw["drive"] |= {"force_N": 0.5 * float(force), "spring_stiffness_N_per_m": 62.0 * float(spring)}
    raw["scenario"]["duration_s"] = 6.0
    raw["effects"] = {"driver_lag": {"time_s": float(rng.uniform(1e-3, 1e-2))}}
    raw |= {"reference": {"kind": "ramp", "speed_mm_s": 10.0}, "checks": {}}
    assert broken(raw, "vibro", seed) == 0
