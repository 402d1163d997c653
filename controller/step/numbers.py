"""A deployment's model, tuning and limits as the C controller's sizes and numbers."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from controller.drives import INNER_MASS, driven_of
from controller.estimator.base import START_STD, Level
from controller.estimator.particle_filter import PARTICLES, SCATTER_S
from controller.estimator.periodic import Periodic
from controller.feedforward import loop_of, remembers
from controller.limits import Envelope
from controller.model.control_model import ControlModel
from controller.mpc.planner import plan_numbers
from controller.registry import SHAKING, build, horizon_of, noise_of
from controller.signals import Array
from controller.step.model_code import literal, model_code
from controller.step.shaking import shaking
from controller.supervision.fallback import Rules
from controller.tuned import FilterNoise, Horizon, Weights
from controller.vibro.controller import VibroController
from models.theta import bare

CHAINS: Final[Mapping[str, tuple[str, ...]]] = {
    "mpc": ("mpc", "feedforward", "pid"),
    "feedforward": ("feedforward", "pid"),
    **dict.fromkeys(SHAKING, (INNER_MASS.leading,)),
}
"""The controllers that are written in C, with their fallbacks."""
_PARAMETERS: Final = "parameters"


@dataclass(frozen=True)
class Numbers:
    """`sizes`: the C macros without their prefix, a whole number or a text; `values`: the entries of `capsule_numbers`
    in order, (k,) or a number each; `model`: the source of its functions.
    """

    sizes: Mapping[str, int | str]
    values: Mapping[str, Array]
    model: str

    @property
    def declared(self) -> str:
        """`numbers.h` without the numbers: one compilation serves all numbers of a kind of model."""
        sizes = "\n".join(f"#define CAPSULE_{name} {value}" for name, value in self.sizes.items())
        fields = "\n".join(f"    real {name}{_dimension(value)};" for name, value in self.values.items())
        return f"{_HEAD}{sizes}\n\ntypedef struct {{\n{fields}\n}} capsule_numbers;\n\n{_FOOT}"

    @property
    def stated(self) -> str:
        """The C constant `capsule_deployment` with the numbers."""
        lines = [f"    {_initial(value)}, /* {name} */" for name, value in self.values.items()]
        return "const capsule_numbers capsule_deployment = {\n" + "\n".join(lines) + "\n};\n"

    @property
    def vector(self) -> Array:
        """All numbers in the order of the C structure."""
        return np.concatenate([value.ravel() for value in self.values.values()])


_HEAD: Final = "/* Generated: sizes of the deployment, and its numbers in SI units. */\n#ifndef CAPSULE_NUMBERS_H\n" + (
    "#define CAPSULE_NUMBERS_H\n\n"
)
_FOOT: Final = "#endif\n"


def _dimension(value: Array) -> str:
    return f"[{value.size}]" if value.ndim else ""


def _initial(value: Array) -> str:
    texts = ", ".join(literal(float(one)) for one in value.flat)
    return f"{{{texts}}}" if value.ndim else texts


def numbers_of(
    controller: str,
    model: ControlModel,
    envelope: Envelope,
    *,
    particles: int = PARTICLES,
    horizon: Horizon | None = None,
) -> Numbers:
    """What the C controller named `controller` of `model` is compiled from, `horizon` in place of its MPC's own. Raises
    ValueError for one that is not written in C, and for a model whose operations are not.
    """
    if controller not in CHAINS:
        raise ValueError(f"controller must be one of {', '.join(CHAINS)}; got {controller!r}")
    (first, *_) = build(controller, model, envelope) if envelope.shaken else (None,)
    own = shaking(first) if isinstance(first, VibroController) else ({}, {})
    sharp, planned = model.sharp, controller == "mpc"
    periodic = Periodic.of(sharp, 1).index
    varied = [Level.index, *periodic.tolist()]
    horizon = (horizon or horizon_of(model)) if planned else Horizon()
    sizes: dict[str, int | str] = {
        "MPC": int(planned),
        "STATES": len(sharp.states),
        "PARAMETERS": len(sharp.symbols.parameters),
        "PARTICLES": particles,
        "VARIED": len(varied),
        "PERIODIC": int(len(varied) > 1),
        **{name: int(k) for name, k in zip(("PERIODIC_SIZE", "PERIODIC_PHASE"), periodic, strict=False)},
        "STAGES": horizon.stages if planned else 0,
        "PLAN_SUBSTEPS": horizon.substeps,
        "ITERATIONS": horizon.iterations,
        **_structure(sharp, envelope),
        **own[0],
    }
    noise = noise_of(controller, sharp, envelope.limits.age_s)
    sizes["KEPT"] = math.ceil((noise.latest_s + sharp.delay_s) / sharp.tick_s) + 2
    values: dict[str, object] = {
        "tick_s": sharp.tick_s,
        "delay_s": sharp.delay_s,
        _PARAMETERS: sharp.values,
        **_started(sharp),
        **{name: getattr(noise, name) for name in _NOISE},
        "level_std": noise.fitted_level_std if sharp.fitted else noise.level_std,
        **dict(zip(("level_low", "level_high", "level_middle"), _level(sharp), strict=True)),
        **_limits(envelope),
        **_rules(Rules()),
        **(own[1] or _loops(model)),
        **(_plan(model, envelope, horizon) if planned else {}),
    }
    arrays = {name: np.array(value, dtype=float) for name, value in values.items()}
    return Numbers(sizes, arrays, model_code(model, envelope, varied, planned))


_NOISE: Final = (
    *("position_std_m", "carriage_std_m", "position_wander_m", "slip_wander_m", "force_wander_N", "push_wander_N"),
    *("force_std_N", "level_wander", "brisk_level_wander", "gate", "outliers_in_a_row", "slips_in_a_row"),
    *("slip_m_s", "proof", "age_s", "lost_std_m"),
)


def _structure(model: ControlModel, envelope: Envelope) -> dict[str, int | str]:
    states, names = model.states, [p.key for p in model.symbols.parameters]
    current = [k for k, name in enumerate(states) if bare(name) == "current_A"]
    return {
        "SUBSTEPS": model.substeps,
        "WALL_STATE": states.index("u") if "u" in states else 0,
        "CURRENT_STATE": f"({current[0] if current else -1})",
        "MODES": "{" + "".join(f"{model.index(name)}, " for name in model.modes) + "-1}",
        "GRIP": f"({names.index('friction_coefficient') if 'u' in states else -1})",
        "PLAIN": int(model.placed),
        "ANCHORED": int(model.drive.anchored),
        "WALK_TICKS": max(1, round(SCATTER_S / model.tick_s)),
        "PLACED": int(envelope.placed),
        "SHAKEN": int(envelope.shaken),
        "EFFECTS": int(any(p.effect for p in model.symbols.parameters)),
        **({} if envelope.shaken else _reach(model, envelope)),
    }


def _reach(model: ControlModel, envelope: Envelope) -> dict[str, int | str]:
    substeps = replace(model, tick_s=loop_of(model)[1]).substeps
    return {"REMEMBERS": int(remembers(model, envelope)), "REACH_SUBSTEPS": substeps}


def _started(model: ControlModel) -> dict[str, Array]:
    """The state at rest at a position after long under a command, which it is linear in, and its first spread."""
    zero = model.initial()
    spread = [START_STD.get(name, 0.0) if isinstance(name, str) else 0.0 for name in model.states]
    spread[0] = FilterNoise().position_std_m
    return {
        "start": zero,
        "start_by_position": model.initial(1.0, 0.0) - zero,
        "start_by_command": model.initial(0.0, 1.0) - zero,
        "start_std": np.array(spread),
    }


def _level(model: ControlModel) -> tuple[float, float, float]:
    level = Level(model)
    return level.low, level.high, level.middle


def _limits(envelope: Envelope) -> dict[str, float]:
    of = {"speed_m_s", "temperature_C", "derate_C", "gap_stds", "longest_tick_s"}
    limits = {f"most_{name}": getattr(envelope.limits, name) for name in sorted(of)}
    limits |= {"oldest_s": envelope.limits.age_s}
    return {
        name: getattr(envelope, name) for name in ("low", "high", "rate", "acceleration", "gap_m", "sense")
    } | limits


def _rules(rules: Rules) -> dict[str, float]:
    left = ("late_allowed", "deadline_s")
    return {f.name: getattr(rules, f.name) for f in fields(Rules) if f.name not in left}


def _loops(model: ControlModel) -> dict[str, float]:
    """Feedforward and PID."""
    loop, reach_s = loop_of(model)
    gains = driven_of(model.drive).pid_estimated
    found = {f"loop_{f.name}": getattr(loop, f.name) for f in fields(loop)} | {"reach_s": reach_s}
    return found | {f"pid_{name}": getattr(gains, name) for name in ("k_p", "k_i", "k_d", "windup_N")}


def _plan(model: ControlModel, envelope: Envelope, horizon: Horizon) -> dict[str, object]:
    numbers = plan_numbers(model, envelope, Weights(), horizon)
    found = {name: getattr(horizon, name) for name in ("stage_s", "rest_m", "late_slip", "hold_s", "hold_m")}
    return found | numbers._asdict()
