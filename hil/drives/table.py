"""What the tables of other makers' drives have in common."""

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import Annotated, ClassVar, Final, Literal

import can
from pydantic import AfterValidator, Field

from hil.bus.wrapping import heard_for, waiting
from models.rigs.schema import NamedTable, key

NODE: Final = "node of the carriage's drive, clear of the catalogue's identifiers"
TURNS: Final = (1.0, 1e5)
"""The fewest and the most turns in a metre."""

RESTS_M_S: Final = 5e-3
"""Below this speed a drive that is not led is at rest, for what its encoder's noise makes of its speed."""


class ActuatorTable(NamedTable):
    """A table that names a drive, which is the carriage; `fd` where its frames are CAN FD."""

    fd: ClassVar[bool] = False
    node_id: int = key(NODE)
    answers_s: float = key("how long it may take to answer", 2.0, 0.1, 60.0)

    @property
    def node(self) -> str:
        """What sentences call the drive."""
        return f"{self.where}: node {self.node_id}"

    def must(self, fine: object, words: str, part: str = "") -> None:
        """Raises ValueError of one sentence, what it or its `part` must instead in `words`, where it is not `fine`."""
        if not fine:
            raise ValueError(f"{self.node}{part} must {words}")

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


def _turns(value: float) -> float:
    if not TURNS[0] <= abs(value) <= TURNS[1]:
        raise ValueError(f"must lie in [{TURNS[0]:g}, {TURNS[1]:g}], with either sign; got {value:g}")
    return value


class TurningTable(ActuatorTable):
    """One that counts in turns, follows places, has a watchdog and coasts without torque."""

    turns_per_m: Annotated[
        float, AfterValidator(_turns), Field(json_schema_extra={"minimum": TURNS[0], "maximum": TURNS[1]})
    ] = key(
        "turns that it tells (an ODrive its motor's, a moteus its output's, behind"
        " `motor_position.rotor_to_output_ratio`), per metre of the carriage; negative: the other way",
        100.0,
    )
    watchdog_s: float = key(
        "longest time without a command after which its own watchdog must have stopped it", 0.02, 0.004, 0.1
    )
    coast_m_s2: float = key(
        "deceleration of the carriage without torque, by friction of guide and screw: measure it", 5.0, 0.1, 100.0
    )
    home: Literal["kept", "here"] = key(
        "`kept`: its own zero (a moteus: home state 2, known at the output); `here`: the place where it stands as it is"
        " set up",
        "kept",
    )

    def stops_s(self, speed_m_s: float) -> float:
        """The watchdog, and coasting to rest."""
        return self.watchdog_s + abs(speed_m_s) / self.coast_m_s2


_SKIPPED = 20_000  # frames that are let go before a question


class Questions:
    """`speaker` says of a frame which node it is from, -1 where it is none of the maker's drives."""

    def __init__(self, bus: can.BusABC, table: ActuatorTable, speaker: Callable[[can.Message], int]) -> None:
        self._bus, self._table, self._speaker, self.node = bus, table, speaker, table.node
        self._errors, self._others = 0, set[int]()

    def send(self, message: can.Message) -> None:
        """Send one frame; what came before is let go. Raises ValueError where the bus does not take it."""
        try:
            for _ in waiting(self._bus, _SKIPPED):
                pass
            self._bus.send(message, timeout=0.1)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            raise ValueError(f"{self.node} must be reached; got: {error}") from None

    def heard(self, seconds: float) -> Iterator[can.Message]:
        for message in heard_for(self._bus, seconds):
            self._errors += message.is_error_frame
            speaker = self._speaker(message)
            if speaker == self._table.node_id:
                yield message
            elif speaker > 0:
                self._others.add(speaker)

    def answer(self, question: Callable[[], can.Message], fits: Callable[[can.Message], bool]) -> can.Message | None:
        """The frame that answers, asked for again each 0.1 s, for as long as the drive may take to be found."""
        end = time.monotonic() + self._table.answers_s
        while time.monotonic() < end:
            self.send(question())
            if (found := next(filter(fits, self.heard(0.1)), None)) is not None:
                return found
        return None

    def silent(self, of_errors: str, of_silence: str) -> ValueError:
        """That it did not answer, who speaks instead, and what to look at where there were error frames, or silence."""
        speak = f"; node {', '.join(map(str, sorted(self._others)))} speaks" if self._others else ""
        broken = f"; {self._errors} error frames: {of_errors}" if self._errors else ""
        silence = "" if speak or broken else f"; silence: {of_silence}"
        return ValueError(f"{self.node} must answer within {self._table.answers_s:g} s{speak}{broken}{silence}")
