"""What friction a control model has on average, and how far off its forces proved to be."""

from controller.model.control_model import ControlModel
from models.rigs.kinds import surface_of

LEAST_OFF_N = 1e-4  # however good a model proved
AT_FIRST = 5.0  # times what it proved off that it may be off at the start


def mean_friction(model: ControlModel, speed_m_s: float = 1e-3) -> float:
    """Friction in N: `F_e + f_c/2` at `speed_m_s`, the mean of the saw; on a plate Coulomb's."""
    p = model.theta.base
    surface = surface_of(model.rig)
    pressing = model.drive.pressing(0.0, 0.0, p)
    friction, onset = surface.hold(speed_m_s, p, model.drive.carried_kg, pressing=pressing)
    return float(friction + 0.5 * onset)


def proved_off(model: ControlModel) -> float | None:
    """By how much in N the forces of `model` were off on records that it had not seen, at least `LEAST_OFF_N`: behind a
    magnet the position's error times its stiffness, of other drives None as where nothing is known.
    """
    if model.held_out_error is None or model.drive.gap_limit_m is None:
        return None
    return max(model.held_out_error * model.force_per_command, LEAST_OFF_N)


def level_off(model: ControlModel) -> float | None:
    """The same as a share of the mean friction."""
    off = proved_off(model)
    return None if off is None else off / mean_friction(model)
