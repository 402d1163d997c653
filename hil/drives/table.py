"""What the tables of other makers' drives have in common."""

import time
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, ClassVar, Final, Literal

import can
from pydantic import AfterValidator, Field

from hil.bus.wrapping import heard_for, waiting
from hil.nodes.frame_map import frames
from models.files.toml import beside
from models.rigs.schema import NamedTable, key

CODES: Final = beside(__file__, "codes.toml")
NODE: Final = "node of the carriage's drive, clear of the catalogue's identifiers"
TURNS: Final = (1.0, 1e5)  # least and most turns per metre
RESTS_M_S: Final = 5e-3  # measured speed below which a disabled drive is at rest: its encoder's noise stays below


def faults_of(codes: Mapping[str, list[str]]) -> dict[int, tuple[str, int]]:
    """A maker's faults by number: name, and the catalogue's code."""
    known = frames()["CarriageFault"].field("Code")
    return {int(code, 0): (words, known.number(fault)) for code, (words, fault) in codes.items()}


class ActuatorTable(NamedTable):
    """The table of a drive that is the carriage; with `fd` its frames are CAN FD."""

    fd: ClassVar[bool] = False
    node_id: int = key(NODE)
    answers_s: float = key("longest time to an answer", 2.0, 0.1, 60.0)

    @property
    def node(self) -> str:
        return f"{self.where}: node {self.node_id}"

    def must(self, fine: object, words: str, part: str = "") -> None:
        """Unless `fine`, raises ValueError of one sentence: it or its `part` must do as `words` say."""
        if not fine:
            raise ValueError(f"{self.node}{part} must {words}")

    def must_rest(self, speed_m_s: float, got: str, most_m_s: float = RESTS_M_S) -> None:
        """Raises ValueError if it moves, with `got` as what was measured."""
        self.must(abs(speed_m_s) <= most_m_s, f"rest before the run; {got}")

    def must_stand_within(self, travel_m: float, position_m: float, remedy: str) -> None:
        """Raises ValueError if its position is beyond the travel, with the remedy."""
        words = f"stand within limits.travel_m, {travel_m:g} m of its zero; got {position_m:g} m: {remedy}"
        self.must(abs(position_m) <= travel_m, words)

    @abstractmethod
    def orders(self, message: can.Message) -> bool:
        """Whether `message` commands this drive."""

    @abstractmethod
    def identifiers(self) -> tuple[frozenset[int], frozenset[int]]:
        """The identifiers of frames to the drive, and of its own frames."""

    @abstractmethod
    def stops_s(self, speed_m_s: float) -> float:
        """The longest time in s from the last command until the carriage, moving at `speed_m_s`, rests."""

    def check_speed(self, speed_m_s: float) -> None:
        """Raises ValueError if its frames cannot carry `limits.carriage_speed_m_s`."""


def _turns(value: float) -> float:
    if not TURNS[0] <= abs(value) <= TURNS[1]:
        raise ValueError(f"must lie in [{TURNS[0]:g}, {TURNS[1]:g}], with either sign; got {value:g}")
    return value


class TurningTable(ActuatorTable):
    """The table of a drive that counts turns, follows positions, has a watchdog and coasts without torque."""

    turns_per_m: Annotated[
        float, AfterValidator(_turns), Field(json_schema_extra={"minimum": TURNS[0], "maximum": TURNS[1]})
    ] = key(
        "turns per metre of the carriage, as the drive counts them (ODrive: of the motor; moteus: of the output, behind"
        " `motor_position.rotor_to_output_ratio`); negative: reversed",
        100.0,
    )
    watchdog_s: float = key("longest time without a command until its own watchdog stops it", 0.02, 0.004, 0.1)
    coast_m_s2: float = key("deceleration of the carriage without torque, to be measured", 5.0, 0.1, 100.0)
    home: Literal["kept", "here"] = key(
        "zero: `kept` is the drive's own (moteus: home state 2), `here` its position during set-up", "kept"
    )

    def stops_s(self, speed_m_s: float) -> float:
        """The watchdog's time and that of coasting to rest."""
        return self.watchdog_s + abs(speed_m_s) / self.coast_m_s2


_SKIPPED = 20_000  # frames that are let go before a question


class Questions:
    """Questions to a drive and its answers during set-up; `speaker` gives the node of a frame, -1: not the maker's."""

    def __init__(self, bus: can.BusABC, table: ActuatorTable, speaker: Callable[[can.Message], int]) -> None:
        self._bus, self._table, self._speaker, self.node = bus, table, speaker, table.node
        self._errors, self._others = 0, set[int]()

    def send(self, message: can.Message) -> None:
        """Discard the waiting frames and send one. Raises ValueError if the bus does not take it."""
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
        """The frame that answers; the question is repeated each 0.1 s for `answers_s`, then None."""
        end = time.monotonic() + self._table.answers_s
        while time.monotonic() < end:
            self.send(question())
            if (found := next(filter(fits, self.heard(0.1)), None)) is not None:
                return found
        return None

    def silent(self, of_errors: str, of_silence: str) -> ValueError:
        """The error of a drive that does not answer: other nodes that send, causes of error frames or of silence."""
        speak = f"; node {', '.join(map(str, sorted(self._others)))} speaks" if self._others else ""
        broken = f"; {self._errors} error frames: {of_errors}" if self._errors else ""
        silence = "" if speak or broken else f"; silence: {of_silence}"
        return ValueError(f"{self.node} must answer within {self._table.answers_s:g} s{speak}{broken}{silence}")
