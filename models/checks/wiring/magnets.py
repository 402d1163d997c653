"""Magnets so near each other that they are no dipoles."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import View
from models.laws.dipole import too_strong
from models.rigs.magnets import Magnets


def check_magnets(view: View) -> list[RecordFinding]:
    """Two cylinders of `[rig.magnet]` whose force the dipoles miss by more than a tenth."""
    magnets = view.rig.magnets
    off = None if magnets is None else dipole_error(magnets)
    if magnets is None or off is None or abs(off) <= SET.dipoles:
        return []
    strong = "strong" if off > 0 else "weak"
    return [
        view.finding(
            "near_magnets",
            "note",
            f"[rig.magnet] height_m = {magnets.height_m:g}",
            f"the dipoles of [rig.magnet] are {abs(off):.0%} too {strong} for cylinders of this size at"
            f" {magnets.height_m:g} m; within {SET.dipoles:.0%}"
            f" they hold from {dipoles_hold_from_m(magnets):.2g} m on",
            "force between the charges on both cylinders' ends against that of two dipoles",
            "give the measured magnet_stiffness_N_per_m under [rig], or measure further away",
        )
    ]


def dipole_error(magnets: Magnets) -> float | None:
    """By which share the dipoles are too strong (negative: too weak) at the magnets' height; None where their sizes are
    not known.
    """
    sizes = magnets.cylinders()
    return None if sizes is None else too_strong(*sizes, magnets.height_m, magnets.moments)


def dipoles_hold_from_m(magnets: Magnets) -> float:
    """The height in m from which on the dipoles are off by no more than a tenth; infinite where that is too far."""
    sizes = magnets.cylinders()
    if sizes is None:
        return magnets.height_m
    heights = magnets.height_m * SET.dipoles_step ** np.arange(SET.dipoles_steps)
    off = np.array([abs(too_strong(*sizes, height, magnets.moments)) for height in heights.tolist()])
    beyond = np.flatnonzero(off > SET.dipoles)
    last = -1 if beyond.size == 0 else int(beyond[-1])
    return float(heights[last + 1]) if last + 1 < off.size else float("inf")
