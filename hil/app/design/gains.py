"""The gains in words: those designed, with their units, and those that the controllers of track, sil and run have."""

from __future__ import annotations

from typing import Any

from controller.baselines.classical import CLASSICAL, CLASSICAL_FRICTION
from controller.baselines.lqr import Gains, lqr_gains
from controller.baselines.pid import TUNED
from controller.design.tuning import Pid
from controller.model.control_model import ControlModel
from controller.model.linear import linearise
from models.theta import spelled


def command_unit(model: ControlModel) -> str:
    """Unit of the command: m of a carriage, A or V of a coil."""
    return model.command_name.rpartition("_")[2]


def gains_json(pid: Pid, lqr: Gains, unit: str) -> dict[str, Any]:
    """The designed gains; K_p in `command_unit` per m."""
    return {
        "command_unit": unit,
        "pid": {"K_p": pid.K_p, "K_i_per_s": pid.K_i, "K_d_s": pid.K_d, "filter_s": pid.filter_s},
        "lqr": {"K": dict(zip(map(spelled, lqr.states), lqr.K.tolist(), strict=True)), "K_i_per_s": lqr.K_i},
    }


def gains_words(pid: Pid, lqr: Gains, model: ControlModel) -> list[str]:
    """Lines for the designed gains, and for those of the controllers that run."""
    unit = command_unit(model)
    own = f"K_p {pid.K_p:.4g} {unit}/m, K_i {pid.K_i:.4g} {unit}/(m s), K_d {pid.K_d:.4g} {unit} s/m"
    return [
        f"PID, from position error to {model.command_name}: {own} (filter {1e3 * pid.filter_s:g} ms)",
        f"LQR: {_feedback(lqr, unit)}",
        "not used by track, sil and run, whose controllers have these gains, whatever the delay:",
        *_running(model),
    ]


def _running(model: ControlModel) -> list[str]:
    pids = {"pid": CLASSICAL, "pid_friction": CLASSICAL_FRICTION, "pid_estimated and the PID below the others": TUNED}
    kind = model.drive.name
    lines = [
        f"  {name}, from position error to force: k_p {g.k_p:g} N/m, k_i {g.k_i:g} N/(m s), k_d {g.k_d:g} N s/m"
        for name, g in ((name, table[kind]) for name, table in pids.items())
    ]
    return [
        *lines,
        (
            f"  lqr: {_feedback(lqr_gains(linearise(model, 'slip')), command_unit(model))} at this tick of"
            f" {1e3 * model.tick_s:g} ms"
        ),
    ]


def _feedback(gains: Gains, unit: str) -> str:
    terms = [
        f"{name} {gain:.4g} {_per(unit, name)}" for name, gain in zip(map(spelled, gains.states), gains.K, strict=True)
    ]
    return f"{', '.join(terms)}, K_i {gains.K_i:.4g} {unit}/(m s)"


def _per(unit: str, state: str) -> str:
    """Unit of a gain on `state`."""
    if state == "v":
        return f"{unit} s/m"
    return f"{unit}/{'m' if state == 'x' else state.rpartition('_')[2]}"
