"""The numbers of a native node: frames in C by cantools, and the deployment's fence, frame map and reference."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields
from typing import Final

import cantools
import numpy as np
from cantools.database import Database
from cantools.database.can.c_source import camel_to_snake_case, generate

from controller.limits import Envelope
from controller.reference import STEP_S, Trajectory
from hil.app.scenario.deployment import Deployment
from hil.bus.catalogue import DBC
from hil.nodes.frame_map import controllers_frames, frame_map_of, frames
from hil.nodes.guard import Fence

_STRAIGHT_M: Final = 1e-12
"""Farthest of a reference from the straight line between two of its knots."""


def node_sources(deployment: Deployment, envelope: Envelope) -> Mapping[str, str]:
    """`frames.h`, `frames.c` and `deployment.h` of the node of a deployment."""
    database = cantools.database.load_file(DBC)
    assert isinstance(database, Database)
    header, source, *_ = generate(
        database, "frames", "frames.h", "frames.c", "", node_name="Controller", use_round=True
    )
    made = {"frames.h": header, "frames.c": source}
    undated = {name: re.sub(r"( version \S+) [^\n]*\n", r"\1.\n", text) for name, text in made.items()}
    return {**undated, "deployment.h": _deployment_header(deployment, envelope)}


def _deployment_header(deployment: Deployment, envelope: Envelope) -> str:
    frame_map, known = frame_map_of(deployment.rig.kind), frames()
    tick_s = deployment.control.tick_s
    fence = Fence.of(envelope, frame_map, tick_s)
    own = ("FEEDBACK", "FAULT", "HEARTBEAT", "CHALLENGE", "COMMAND")
    named = {part: getattr(frame_map, part.lower()) for part in own}
    common = ("CapsuleLocalisation", "Sync", "ControllerHeartbeat", "EnableAnswer", "SafeStop")
    named |= {camel_to_snake_case(name).upper(): name for name in common}
    numbers: dict[str, str] = {
        f"NODE_{camel_to_snake_case(frame_map.node).upper()}": "1",
        "NODE_CHANNEL": "CAPSULE_COMMANDED",
        "NODE_TICK_S": repr(tick_s),
        "NODE_DURATION_S": repr(deployment.control.duration_s),
        "NODE_CATALOGUE": f"{known.fingerprint}u",
        "NODE_TARGET": f"{frame_map.target}u",
        "NODE_STILL_MS": repr(float(frame_map.still_ms)),
        "NODE_BRAKING": _number(frame_map.braking_m_s2),
        "NODE_FEEDBACK_S": repr(fence.feedback_s),
        "NODE_FENCE": _braced(_number(getattr(fence, f.name)) for f in fields(fence) if f.name != "late_stop"),
        "NODE_CONTROLLERS_FRAMES": _braced(f"{number}u" for number in sorted(controllers_frames())),
    }
    for part, name in named.items():
        numbers |= {f"{part}_DATA_ID": f"{known[name].data_id}u", f"{part}_CYCLE_S": repr(known[name].cycle_s)}
    times_s, places_m = knots(deployment.reference)
    numbers |= {
        "REFERENCE_S": _braced(f"{t:.9g}" for t in times_s),
        "REFERENCE_M": _braced(f"{x:.12g}" for x in places_m),
    }
    lines = "\n".join(f"#define {name} {value}" for name, value in numbers.items())
    return f"/* Generated: the deployment's frames, limits and reference. */\n#include <math.h>\n\n{lines}\n"


def knots(reference: Trajectory) -> tuple[list[float], list[float]]:
    """Times in s and positions in m between which a reference is straight."""
    bends = np.abs(np.diff(reference.positions, 2)) > _STRAIGHT_M
    kept = np.flatnonzero(np.concatenate([[True], bends, [True]]))
    return (kept * STEP_S).tolist(), reference.positions[kept].tolist()


def _number(value: float) -> str:
    return "INFINITY" if np.isposinf(value) else "-INFINITY" if np.isneginf(value) else repr(float(value))


def _braced(values: Iterable[str]) -> str:
    return "{" + ", ".join(values) + "}"
