"""Chosen hidden effects as the table of numbers for the compiled steps."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.files.toml import check_known
from plant.compiling import compiled
from plant.hidden.registry import HIDDEN, ONSET, ROW, ROWS, HiddenNumber, hidden
from plant.tables import Floats


@compiled
def _any(h: Floats, first: int, last: int) -> bool:
    found = False
    for row in range(first, last + 1):
        found = found or h[row, 0] != 0.0
    return found


@compiled
def has_level(h: Floats) -> bool:
    return _any(h, ROW.stribeck, ROW.rolling_wobble)


@compiled
def has_force(h: Floats) -> bool:
    return _any(h, ROW.viscous_drag, ROW.stress_relaxation)


@compiled
def has_drive(h: Floats) -> bool:
    return _any(h, ROW.coupling_decay, ROW.back_emf) or bool(h[ROW.string_compliance, 0] != 0.0)


SLOTS: Final = 4  # numbers of an effect at most
_FAR: Final = 1e3  # factor on the end of a range beyond which a number is a mistake
_LATEST_S: Final = 1e6  # onset of an effect
ONSET_KEY: Final = "onset_s"


def effect_table(chosen: dict[str, dict[str, float]]) -> NDArray[np.float64]:
    """`h[row, slot]` for the compiled steps: chosen effects with their numbers, missing ones at the middle of their
    range, all others off. `onset_s` is when an effect begins, and its time counts from there. Raises `ValueError` for
    an unknown effect or number, with the nearest name, and for an impossible number.
    """
    table = np.zeros((len(HIDDEN), SLOTS))
    for row, effect in enumerate(HIDDEN):
        table[row, : len(effect.numbers)] = [shape.middle for shape in effect.numbers]
        table[row, 0] = 0.0
    for name, numbers in chosen.items():
        effect = hidden(name)
        names = [*(shape.name for shape in effect.numbers), ONSET_KEY]
        check_known(numbers, names, f"numbers of {name} must be among")
        for slot, shape in enumerate(effect.numbers):
            table[ROWS[name], slot] = _possible(numbers.get(shape.name, shape.middle), shape, slot == 0, name)
        onset = numbers.get(ONSET_KEY, 0.0)
        if not 0 <= onset <= _LATEST_S:
            raise ValueError(
                f"effects.{name}.{ONSET_KEY} must be zero or more and at most {_LATEST_S:g} s; got {onset:g}"
            )
        table[ROWS[name], ONSET] = onset
    return table


def begun(table: Floats, time_s: float) -> Floats:
    found = table.copy()
    found[found[:, ONSET] > time_s + 1e-9, 0] = 0.0
    return found


def _possible(value: float, number: HiddenNumber, amplitude: bool, effect: str) -> float:
    """The checked number: lengths, times and compliances are not negative, numbers of a shape positive except positions
    and phases, and all within `_FAR` of the declared range.
    """
    where, most = f"effects.{effect}.{number.name}", _FAR * number.upper
    shape = not amplitude and number.name not in ("phase_rad", "centre_m")
    size = amplitude and number.name.endswith(("_s", "_m", "_per_N"))
    if (shape and not value > 0) or (size and not value >= 0):
        raise ValueError(f"{where} must be {'positive' if shape else 'zero or more'}; got {value:g}")
    if not abs(value) <= most or (shape and value < number.lower / _FAR):
        least = f"{number.lower / _FAR:g} to " if shape else "at most "
        raise ValueError(f"{where} must be {least}{most:g}{'' if shape else ' either way'}; got {value:g}")
    return value
