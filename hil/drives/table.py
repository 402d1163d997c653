"""What the tables of other makers' drives have in common."""

from abc import abstractmethod
from dataclasses import fields
from typing import ClassVar, Final

import can

from models.files.tables import Declared, check_ranges, check_word

HOMES: Final = ("kept", "here")
"""What becomes of the drive's zero: it stays, or is made the present place."""

RESTS_M_S: Final = 5e-3
"""Below this speed a drive that is not led is at rest, for what its encoder's noise makes of its speed."""


class ActuatorTable(Declared, where=""):
    """A table that names a drive, which is the carriage: node `node_id`, looked for during `answers_s`; `fd` where its
    frames are CAN FD. A field with the metadata `read` is a table within it.
    """

    fd: ClassVar[bool] = False
    node_id: int
    answers_s: float

    @property
    def node(self) -> str:
        """What sentences call the drive."""
        return f"{self.where}: node {self.node_id}"

    def must(self, fine: object, words: str) -> None:
        """Raises ValueError of one sentence, what it must instead in `words`, where it is not `fine`."""
        if not fine:
            raise ValueError(f"{self.node} must {words}")

    def must_rest(self, speed_m_s: float, told: str, most_m_s: float = RESTS_M_S) -> None:
        """The same where it does not rest, as `told`."""
        self.must(abs(speed_m_s) <= most_m_s, f"rest before it is led; {told}")

    def must_stand_within(self, travel_m: float, place_m: float, remedy: str) -> None:
        """The same where it stands beyond the travel, with what to do."""
        words = f"stand within limits.travel_m, {travel_m:g} m of its zero; got {place_m:g} m: {remedy}"
        self.must(abs(place_m) <= travel_m, words)

    @abstractmethod
    def orders(self, message: can.Message) -> bool:
        """Whether `message` is one by which a master commands this drive."""

    @abstractmethod
    def identifiers(self) -> tuple[frozenset[int], frozenset[int]]:
        """The identifiers by which the drive is spoken to, and those by which it speaks."""

    @abstractmethod
    def stops_s(self, speed_m_s: float) -> float:
        """The longest time in s from the last command to the carriage at rest, from `speed_m_s`."""

    def check_speed(self, speed_m_s: float) -> None:
        """Raises ValueError where its frames cannot carry `limits.carriage_speed_m_s`."""


class TurningTable(ActuatorTable, where=""):
    """One that counts in turns, follows places, has a watchdog and coasts without torque."""

    turns_per_m: float
    watchdog_s: float
    coast_m_s2: float
    home: str

    def __post_init__(self) -> None:
        ranges = [(one.name, *one.metadata["range"]) for one in fields(self) if "range" in one.metadata]  # type: ignore[arg-type]
        check_ranges(self, self.where, ranges, either_sign=("turns_per_m",))
        check_word(self.home, f"{self.where}.home", HOMES)

    def stops_s(self, speed_m_s: float) -> float:
        """The watchdog, and coasting to rest."""
        return self.watchdog_s + abs(speed_m_s) / self.coast_m_s2
