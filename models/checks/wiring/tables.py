"""Tables (friction, moduli, mean speeds, slip periods): values that no such rig gives, signs that give energy."""

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import View
from models.checks.wiring.units import beyond_its_range, off_its_size
from models.rigs.dma import DMA
from models.rigs.friction import FRICTION
from models.rigs.vibro_table import VIBRO_TABLE


def check_table(view: View) -> list[RecordFinding]:
    """What is wrong with a table before any fit."""
    if view.kind.layout.time or not len(view.record):
        return []
    wrong = _out_of_range(view)
    return wrong or [*_constant(view), *_OWN.get(view.kind.id, _nothing)(view)]


def _out_of_range(view: View) -> list[RecordFinding]:
    """Columns with a value that they cannot have, or that reach what no such rig does."""
    found = []
    for column, values in view.record.columns.items():
        wrong = beyond_its_range(view, column, view.unit_line(column))
        low, high, unit = view.kind.usual.get(column, (0.0, math.inf, ""))
        size = float(np.nanmax(np.abs(values)))
        if not wrong and not low <= size <= high:
            wrong = [off_its_size(view, column, f"goes up to {size:.3g}", (low, high), unit)]
        found += wrong
    return found


def _constant(view: View) -> list[RecordFinding]:
    """A measured column that is the same under every condition."""
    driven = [name for names in view.record.layout.driven for name in names if name in view.record.columns]
    conditions = len(np.unique(np.column_stack([view.record[name] for name in driven]), axis=0)) if driven else 0
    if conditions < SET.conditions or np.ptp(view.y):
        return []
    return [
        view.finding(
            "no_response",
            "stops",
            f"{view.measured}, throughout",
            f"{view.measured} must change to tell anything; got {view.y[0]:.6g} throughout: was it measured?",
            f"all values are equal, under {conditions} conditions",
            "log the sensor, or give the column that holds it: [columns]",
        )
    ]


def _friction(view: View) -> list[RecordFinding]:
    """Friction resists: its sign is that of the speed, wherever it is measured both ways."""
    speed, friction = view.record["velocity_m_s"], view.y
    against = np.sign(speed) * np.sign(friction) < 0
    if view.measured == "friction_coefficient" or not against.any():
        return []
    if np.mean(against) > 1 - SET.conditions_against:
        return [
            view.finding(
                "force_sign",
                "stops",
                f"{view.measured} against velocity_m_s, throughout",
                f"{view.measured} has the sign of a force that drives the motion which it should resist",
                f"{int(against.sum())} of {len(against)} conditions with force and speed of opposite signs",
                view.turned_line(view.measured),
            )
        ]
    both = (speed > 0).any() and (speed < 0).any()
    if both and len(np.unique(np.sign(friction))) == 1:
        return [
            view.finding(
                "force_unsigned",
                "stops",
                f"{view.measured} against velocity_m_s, throughout",
                f"{view.measured} has one sign at speeds of both: its sign was not logged",
                f"{int((speed < 0).sum())} of {len(speed)} conditions at negative speeds",
                "log both with their signs, or both without",
            )
        ]
    return []


def _moduli(view: View) -> list[RecordFinding]:
    """Loss over storage modulus, as every material has it."""
    ratio = view.record["loss_modulus_Pa"] / view.record["storage_modulus_Pa"]
    usual = float(np.median(ratio))
    if SET.loss_ratio[0] <= usual <= SET.loss_ratio[1]:
        return []
    return [
        view.finding(
            "units",
            "stops",
            "loss_modulus_Pa against storage_modulus_Pa, throughout",
            f"loss_modulus_Pa is {usual:.3g} times storage_modulus_Pa; materials have {SET.loss_ratio[0]:g} to"
            f" {SET.loss_ratio[1]:g}: another unit of one of the two?",
            "median of the ratio",
            view.unit_line("loss_modulus_Pa"),
        )
    ]


def _mean_speeds(view: View) -> list[RecordFinding]:
    """The drive's periods beside its spring's."""
    drive = view.rig.drive
    if drive is None or not drive.spring_stiffness_N_per_m:
        return []
    own = 2 * math.pi * math.sqrt(drive.inner_mass_kg / drive.spring_stiffness_N_per_m)
    usual = float(np.median(view.record["period_s"]))
    if own / SET.period_ratio <= usual <= own * SET.period_ratio:
        return []
    return [
        view.finding(
            "units",
            "stops",
            "period_s, throughout",
            f"period_s is {usual:.3g}, where the inner mass swings on its spring in {own:.3g} s: another unit, or a"
            " frequency?",
            "median of the periods against the spring and the mass of the rig file",
            f"{view.columns_line('period_s', unit='ms')}, where the file is in ms",
        )
    ]


def _nothing(view: View) -> Sequence[RecordFinding]:
    return ()


_OWN: Mapping[str, Callable[[View], Sequence[RecordFinding]]] = MappingProxyType(
    {FRICTION.id: _friction, DMA.id: _moduli, VIBRO_TABLE.id: _mean_speeds}
)
