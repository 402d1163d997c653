"""Frames for display: estimate, reference, and the monitor's verdict on the model."""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from controller.model.control_model import ControlModel
from controller.monitor import Health
from controller.signals import Estimate, Reference
from hil.bus.codec import NO_SURPRISE
from hil.nodes.frame_map import LONGEST_S

VIEW_S: Final = 0.04  # period
WALL: Final[Mapping[str, int]] = {"sticks": 0, "slips_forward": 1, "slips_backward": 2, "lost": 3}
_FARTHEST_M, _WIDEST_M, _FASTEST_M_S, _STRONGEST_N, _MOST_STDS = 1.1, 0.0819, 0.4, 6.5, 9.98  # ranges in the frame


def motion_values(model: ControlModel, estimate: Estimate, surprise: float) -> dict[str, float]:
    """The signals of BelievedMotion; `surprise` in standard deviations, NaN: none. A non-finite estimate is "lost"."""
    x = model.index("x")
    lost = estimate.lost or not math.isfinite(estimate.state[x] + estimate.std[x])
    return {
        "Position_m": within(estimate.state[x], _FARTHEST_M),
        "Std_m": abs(within(estimate.std[x], _WIDEST_M)),
        "Wall": WALL["lost"] if lost else _wall(model, estimate),
        "Surprise": within(surprise, _MOST_STDS) if math.isfinite(surprise) else NO_SURPRISE,
    }


def force_values(model: ControlModel, estimate: Estimate, command: float, now: float) -> dict[str, float] | None:
    """The signals of BelievedForces with `command` in force at `now`; None if one is not finite."""
    x, v = (float(estimate.state[model.index(name)]) for name in ("x", "v"))
    drive = model.drive.force(x, v, command / model.drive.command_unit, model.theta.base)
    wall = model.symbols.wall_force(estimate.state, now, model.values)
    forces = {"Drive_N": drive, "Wall_N": wall, "Lacking_N": estimate.disturbance_N}
    if not all(math.isfinite(float(force)) for force in forces.values()):
        return None
    return {name: within(float(force), _STRONGEST_N) for name, force in forces.items()}


def wanted_values(position_m: float, speed_m_s: float, follows: bool, switches: int) -> dict[str, float]:
    """The signals of WantedMotion; a non-finite reference is not followed."""
    return {
        "Position_m": within(position_m, _FARTHEST_M),
        "Velocity_m_s": within(speed_m_s, _FASTEST_M_S),
        "Following": float(follows and math.isfinite(position_m + speed_m_s)),
        "Model": min(switches, 255),
    }


def _wall(model: ControlModel, estimate: Estimate) -> int:
    """Stick or slip of the wall; on a rigid surface, whether the capsule moves."""
    name, least = ("slip", 0.5) if "slip" in model.states else ("v", 5 * model.smoothing)
    slip = float(estimate.state[model.index(name)])
    return WALL["slips_forward"] if slip > least else WALL["slips_backward"] if slip < -least else WALL["sticks"]


def sampled(reference: Reference, time_s: float) -> tuple[float, float]:
    at = np.array([time_s])
    return float(reference.position(at)[0]), float(reference.speed(at)[0])


def within(value: float, most: float) -> float:
    """`value` limited to [-most, most]; 0 if it is not finite."""
    return min(max(float(value), -most), most) if math.isfinite(value) else 0.0


HEALTH_S: Final = 0.1  # period
STATES: Final[Mapping[str, int]] = {"holds": 0, "doubtful": 1, "broken": 2, "not watched": 3}
CHANGES: Final[Mapping[str, int]] = {"": 0, "sudden": 1, "slow": 2}
_MOST: Final = 2.55  # upper end of the range in the frame


def health_values(health: Health, began_s: float) -> dict[str, float]:
    """The signals of ModelHealth; times count from the node's start `began_s`."""
    return {
        "State": STATES[health.state],
        "Change": CHANGES[health.change],
        "Since_s": min(max(health.since_s - began_s, 0.0), LONGEST_S),
        "Evidence": min(max(health.evidence, 0.0), _MOST),
        "Alarms": min(health.alarms, 255),
    }
