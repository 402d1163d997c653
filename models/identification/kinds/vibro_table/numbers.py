"""The numbers of a body with an inner mass on a plate, as the compiled solver takes them."""

from typing import NamedTuple

GRAVITY = 9.81  # m/s2


class VibroCycle(NamedTuple):
    """Numbers of the drive, SI; everything after `coulomb_N` is beyond the base model and absent at its default."""

    body_kg: float
    inner_kg: float
    stiffness: float
    force_N: float
    coulomb_N: float
    reaction: float = 1.0
    damping: float = 0.0
    dry_N: float = 0.0
    cubic: float = 0.0
    cubic_power: float = 3.0
    stop_stiffness: float = 0.0
    stop_gap_m: float = 1.0
    stop_loss_s: float = 0.0
    current_lag_s: float = 0.0
    force_lag_s: float = 0.0
    reach_per_m: float = 0.0
    asymmetry: float = 0.0
    incline_N: float = 0.0
    drag_N: float = 0.0
    drag_power: float = 1.0
    stribeck: float = 0.0
    stribeck_speed: float = 0.003
    stribeck_power: float = 2.0
