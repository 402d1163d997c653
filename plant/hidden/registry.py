"""The one list of hidden effects: name, form, numbers with ranges, and the drives that can have them."""

from collections import namedtuple
from dataclasses import dataclass
from typing import Any, Final

from models.files.toml import beside
from models.parameter import nearest

PULL, MAGNETIC, COIL, VIBRO, FORCE, AXIS = ANY = "pull", "magnetic", "coil", "vibro", "force", "axis"
"""The simulated drives by name; their true numbers are in `plant.drives`."""
SIGNED: Final = -1.0  # third number of a range whose values may be negative
LAG_SHARES: Final = (1 / 2, 1 / 3, 1 / 6)  # of a lag's time, one per stage


@dataclass(frozen=True)
class HiddenNumber:
    """One number of an effect, `unit` in its name; random rigs draw it from [`lower`, `upper`]."""

    name: str
    lower: float
    upper: float
    sign: float = 1.0

    @property
    def middle(self) -> float:
        return 0.5 * (self.lower + self.upper)


@dataclass(frozen=True)
class Hidden:
    """An effect with its equation `form`: `numbers[0]` is its amplitude, zero switches it off."""

    id: str
    form: str
    numbers: tuple[HiddenNumber, ...]
    drives: tuple[str, ...]


HIDDEN: Final = tuple(
    Hidden(
        name,
        one["form"],
        tuple(HiddenNumber(number, *numbers) for number, numbers in one["numbers"].items()),
        tuple(one.get("drives", ANY)),
    )
    for name, one in beside(__file__, "effects.toml").items()
)
ONSET: Final = 3  # position in an effect's row of its onset time in s; 0: from the beginning
ROWS: Final = {effect.id: row for row, effect in enumerate(HIDDEN)}
ROW: Final[Any] = namedtuple("Row", ROWS)(**ROWS)  # the rows as constants of compiled steps: `ROW.stribeck`


def hidden(name: str) -> Hidden:
    """The effect called `name`; `ValueError` names the nearest one."""
    if name not in ROWS:
        raise ValueError(f"hidden effect must be one of the registry; got {name!r}; {nearest(name, ROWS)}")
    return HIDDEN[ROWS[name]]
