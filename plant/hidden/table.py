"""Chosen hidden effects as the table of numbers that the compiled steps read."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from models.parameter import nearest
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
    """Whether the table `h` holds an effect on the level of resistance."""
    return _any(h, ROW.stribeck, ROW.rolling_wobble)


@compiled
def has_force(h: Floats) -> bool:
    """Whether it holds a hidden force on the body."""
    return _any(h, ROW.viscous_drag, ROW.stress_relaxation)


@compiled
def has_drive(h: Floats) -> bool:
    """Whether it holds an effect between drive and body."""
    return _any(h, ROW.coupling_decay, ROW.back_emf) or bool(h[ROW.string_compliance, 0] != 0.0)


SLOTS: Final = 4  # numbers of an effect at most
_FAR: Final = 1e3  # times the upper end of a number's range, beyond which it is a mistake
_LATEST_S: Final = 1e6  # onset of an effect
ONSET_KEY: Final = "onset_s"


def effect_table(chosen: dict[str, dict[str, float]]) -> NDArray[np.float64]:
    """`h[row, slot]` for the compiled steps: chosen effects with their numbers, a missing one at its middle, all others
    off. `onset_s` among the numbers is when an effect begins; what passes with time counts from there. Raises
    `ValueError` for an unknown effect or number, naming the nearest, and for an impossible number.
    """
    table = np.zeros((len(HIDDEN), SLOTS))
    for row, effect in enumerate(HIDDEN):
        table[row, : len(effect.numbers)] = [shape.middle for shape in effect.numbers]
        table[row, 0] = 0.0
    for name, numbers in chosen.items():
        effect = hidden(name)
        names = [*(shape.name for shape in effect.numbers), ONSET_KEY]
        for key in numbers:
            if key not in names:
                raise ValueError(
                    f"numbers of {name} must be among {', '.join(names)}; got {key!r}; {nearest(key, names)}"
                )
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
    """`table` with the effects off whose onset lies after `time_s`."""
    found = table.copy()
    found[found[:, ONSET] > time_s + 1e-9, 0] = 0.0
    return found


def _possible(value: float, number: HiddenNumber, amplitude: bool, effect: str) -> float:
    """The number itself: lengths, times, compliances are not negative, a shape's numbers positive but for places and
    phases, and none is far from those that a random rig draws.
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


def draw(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Random numbers for an effect, from their ranges."""
    return {shape.name: shape.draw(rng) for shape in hidden(name).numbers}
