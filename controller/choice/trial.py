"""A closed loop in a model of the rig, and how well it tracks a piece of the coming reference."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from controller.choice.world import Localisation, ModelWorld, Possible
from controller.closed_loop import Asked, ClosedLoop
from controller.limits import Limits
from controller.model.control_model import ControlModel
from controller.signals import Reference
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)

LONGEST_S: Final = 5.0
"""Length of the piece of a reference that is simulated: a run's first second and, at 1 to 2 mm/s, a fold of the gut."""
SETTLE_S: Final = 0.5  # of a piece, before which errors do not count
_BETWEEN_S: Final = 1.0  # of the starts of pieces that are compared
_GRID_S: Final = 0.02
_SHARES: Final = np.linspace(0.05, 0.95, 10)


@dataclass(frozen=True)
class Mission:
    """The coming motion: `reference` over `duration_s`, within `limits`, seen by a localisation `seen`; `estimator` by
    name.
    """

    reference: Reference
    duration_s: float
    limits: Limits
    seen: Localisation = Localisation()
    estimator: str = "default"

    def piece(self) -> tuple[float, float]:
        """Begin and end in s of the piece that is simulated: all of a short reference, else that of `LONGEST_S` whose
        speeds are distributed most like those of the whole; the first of equal ones.
        """
        if self.duration_s <= LONGEST_S:
            return 0.0, self.duration_s
        t = np.arange(0.0, self.duration_s, _GRID_S)
        speeds, reach = np.asarray(self.reference.speed(t)), round(LONGEST_S / _GRID_S)
        whole = np.quantile(speeds, _SHARES)
        starts = range(0, t.size - reach + 1, round(_BETWEEN_S / _GRID_S))
        unlike = [float(np.sum(np.abs(np.quantile(speeds[k : k + reach], _SHARES) - whole))) for k in starts]
        begin = float(t[starts[int(np.argmin(unlike))]])
        return begin, begin + LONGEST_S


@dataclass(frozen=True)
class Outcome:
    """The rms error in m of a piece, and whether it ended in a broken hard limit or a stop for good. Where it was not
    `whole`, the error is a bound from below: what followed could only add to it.
    """

    rmse_m: float
    broken: bool = False
    whole: bool = True

    @property
    def cost(self) -> float:
        return math.inf if self.broken else self.rmse_m


def loop_in(
    world: Possible,
    mission: Mission,
    model: ControlModel,
    controller: str,
    begin_s: float = 0.0,
    place_m: float = 0.0,
    seed: int = 1,
) -> tuple[ClosedLoop, ModelWorld]:
    """The loop of `controller` with `model`, and the `world` around it, at rest at `place_m` at `begin_s`."""
    command = place_m if model.drive.anchored else 0.0
    asked = Asked(mission.reference, mission.limits, mission.seen.std_m, mission.estimator, begin_s, command)
    loop = ClosedLoop(asked, model, controller, watched=False)
    return loop, ModelWorld(world, mission.seen, seed, begin_s, place_m, command)


def ended(loop: ClosedLoop, capsule: ModelWorld) -> str:
    """Why a loop in a world is over: a broken hard limit, or a stop for good; "" while it is not."""
    return TEXT("limit") if capsule.broken(loop.asked.limits.speed_m_s) else loop.supervisor.halted


def tried(
    mission: Mission,
    piece: tuple[float, float],
    model: ControlModel,
    controller: str,
    world: Possible,
    most_m: float = math.inf,
    seed: int = 1,
) -> Outcome:
    """`controller` with `model` in the `world` of another over a `piece` of the mission; given up once its error
    exceeds `most_m`, it breaks a limit, or the supervisor stops it for good.
    """
    begin, end = piece
    place_m, ticks = float(mission.reference.position(np.array([begin]))[0]), round((end - begin) / model.tick_s)
    loop, capsule = loop_in(world, mission, model, controller, begin, place_m, seed)
    wanted = mission.reference.position(begin + model.tick_s * np.arange(1.0, ticks + 1.0))
    first = min(round(SETTLE_S / model.tick_s), ticks // 2)
    total, counted = 0.0, ticks - first
    for k, _ in enumerate(loop.run(capsule, ticks)):
        if ended(loop, capsule):
            return Outcome(math.inf, broken=True)
        if k >= first:
            total += (float(capsule.state[0]) - float(wanted[k])) ** 2
            if total > most_m**2 * counted:
                return Outcome(math.sqrt(total / counted), whole=False)
    return Outcome(math.sqrt(total / counted))
