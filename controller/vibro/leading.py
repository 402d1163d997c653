"""From a control model to the vibro drive's controller."""

from __future__ import annotations

from controller.prediction import ControlModel
from controller.vibro.cycles import VibroModel
from controller.vibro.design import designed
from controller.vibro.vibro import Tuning, VibroController


def vibro_controller(model: ControlModel, optimise: bool = True, feedback: bool = True) -> VibroController:
    """The controller that moves `model`'s capsule by its inner mass, with the drive map designed on that model (kept on disk).

    `optimise` False keeps to square waves, `feedback` False to the map alone. Raises ValueError for a rig without an inner mass on a spring.
    """
    values = {p.name: float(v) for p, v in zip(model.symbols.parameters, model.values, strict=True)}
    drive = designed(VibroModel.from_rig(model.rig, values), optimise)
    return VibroController(drive, Tuning(tick_s=model.tick_s, feedback=feedback))
