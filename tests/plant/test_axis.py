"""A simulated axis: rest, steady motion and the force of an imposed motion in closed form, along a line and turning."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plant.experiments.scenario import parse_scenario, record_scenario

LINE = {"mass_kg": 5.0, "viscous_friction_N_s_per_m": 40.0, "coulomb_friction_N": 3.0, "offset_N": 0.5}
TURN = {"inertia_kg_m2": 0.2, "viscous_friction_N_m_s_per_rad": 1.5, "coulomb_friction_N_m": 2.0, "offset_N_m": -0.3}


def simulated(profile: dict[str, Any], axis: dict[str, float] = LINE, **rig: str) -> dict[str, Any]:
    tables = {
        "scenario": {"duration_s": 4.0, "step_s": 1e-4},
        "rig": {"kind": "axis", **rig},
        "axis": axis,
        "profile": profile,
    }
    return record_scenario(parse_scenario(tables, Path()))


@pytest.mark.parametrize(("force", "speed"), [(3.4, 0.0), (-2.4, 0.0), (11.5, 0.2), (-10.5, -0.2)])
def test_a_pushed_axis_rests_within_friction_and_ends_at_the_steady_speed(force: float, speed: float) -> None:
    record = simulated({"kind": "sine", "frequency_Hz": 0.0, "amplitude_N": 1e-9, "offset": force}, driven="force_N")
    x, t = record["position_m"], record["t_s"]
    assert list(record) == ["t_s", "force_N", "position_m"]
    assert (x[-1] - x[-51]) / (t[-1] - t[-51]) == pytest.approx(speed, abs=1e-6)


@pytest.mark.parametrize(("axis", "unit"), [(LINE, "amplitude_m"), (TURN, "amplitude_rad")])
def test_an_imposed_motion_needs_inertia_friction_and_offset(axis: dict[str, float], unit: str) -> None:
    record = simulated({"kind": "sine", "frequency_Hz": 0.5, unit: 0.1}, axis)
    t, x, force = record.values()
    w = np.pi
    v, a = 0.1 * w * np.cos(w * t), -(w**2) * 0.1 * np.sin(w * t)
    mass, viscous, coulomb, offset = axis.values()
    clear = np.abs(v) > 0.01
    expected = mass * a + viscous * v + coulomb * np.sign(v) + offset
    assert np.allclose(force[clear], expected[clear], atol=1e-3 * np.ptp(expected))
    assert np.allclose(x, 0.1 * np.sin(w * t), atol=1e-9)


def test_a_turned_axis_has_angles_and_torques() -> None:
    profile = {"kind": "random_force", "amplitude": 9.0}
    record = simulated(profile, TURN, driven="torque_N_m")
    assert list(record) == ["t_s", "torque_N_m", "angle_rad"]
    assert np.ptp(record["angle_rad"]) > 0.1


@pytest.mark.parametrize(
    ("axis", "rig", "words"),
    [
        (LINE, {"driven": "torque_N_m"}, "driven torque_N_m"),
        ({"coulomb_friction_N": 2.0}, {}, "must have mass_kg"),
        (LINE | TURN, {}, "must have mass_kg"),
        (LINE, {"driven": "coil_current_A"}, "rig.driven"),
        (LINE, {"colour": "red"}, "kind and driven alone"),
    ],
)
def test_what_is_no_axis_is_refused_in_one_sentence(axis: dict[str, float], rig: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        simulated({"kind": "sine", "frequency_Hz": 1.0, "amplitude_m": 0.1}, axis, **rig)
