"""One part of a smooth model's cycle with the wall's stick and slip given: what the optimiser shoots through."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from controller.signals import Array
from controller.vibro.cycles import VibroModel
from models.assembly.effects import Active
from models.assembly.step import Grip, Stepper
from models.drives.vibro import Vibro
from models.effects.effect import Signals
from models.parameter import Name
from models.surfaces.gut import Drag
from models.theta import Theta

NODES: tuple[Name, ...] = ("x", "v", (Vibro.name, "stretch_m"), (Vibro.name, "rate_m_s"), "u")
SCALE = np.array([1e-3, 0.1, 1e-3, 0.1, 1e-4])
"""What every node holds (m, m/s, m, m/s, m) and the size of 1 in it."""


@dataclass(frozen=True)
class KnownSlip(Stepper):
    """A step whose wall keeps the slip that it is told: `u' = v` in stick, `-s v_i` in slip, nothing switches."""

    def drag(self, s: Signals, drag: Drag, v: Any, h: Any, grip: Grip) -> Drag:
        if not self.surface.dragged:
            return drag
        return Drag(drag.u + h * ((1 - drag.slip * drag.slip) * v - drag.slip * grip.recovery), drag.slip)


@dataclass(frozen=True)
class CyclePart:
    """`advance(z, c, h, slip) -> z` over `steps` steps of h in s from the scaled node z (n,), the level c held;
    `strain(z)` = T(u)/f_c of the wall, None on a plate. A node holds the states `names` in units of `scale`.
    """

    names: tuple[Name, ...]
    scale: Array
    steps: int
    advance: ca.Function
    strain: ca.Function | None


def smooth_part(model: VibroModel, smoothing: float, steps: int, lags: Mapping[Name, float]) -> CyclePart:
    """A part of the cycle of `model` with friction smoothed over `smoothing` in m/s. Nodes hold `NODES` and the
    effects' states in `lags`, each with its size; other states of effects stay as they are at the start.
    """
    assembly = model.assembly(smoothing)
    vector = assembly.vector(model.values)
    p = Theta.of((parameter.key, float(v)) for parameter, v in zip(assembly.parameters, vector, strict=True))
    names, scale = (*NODES, *lags), np.concatenate((SCALE, list(lags.values())))
    z, c, h, slip = ca.SX.sym("z", len(names)), ca.SX.sym("c"), ca.SX.sym("h"), ca.SX.sym("slip")
    now: dict[Name, Any] = {name: ca.SX(assembly.initial[name]) for name in assembly.states}
    now |= {name: z[i] * scale[i] for i, name in enumerate(names)} | {"slip": slip}

    def stepper() -> KnownSlip:
        return KnownSlip(model.surface, model.drive, Active.of(model.effects, p, now), None, smoothing)

    for _ in range(steps):
        now, _output = stepper().advance(now, c, c, 0.0, h)
    end = ca.vertcat(*(now[name] / scale[i] for i, name in enumerate(names)))
    advance = ca.Function("advance", [z, c, h, slip], [end])
    if not model.surface.dragged:
        return CyclePart(names, scale, steps, advance, None)
    u, v = z[4] * SCALE[4], z[1] * SCALE[1]
    _, onset = model.surface.hold(np.sqrt(v * v + smoothing**2), p.base, model.drive.carried_kg)
    own = stepper()
    strain = ca.Function("strain", [z], [own.tension(u) * own.stiffening(Signals(), u) / onset])
    return CyclePart(names, scale, steps, advance, strain)
