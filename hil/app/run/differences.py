"""What a replay found: the ticks in which the computed frames are not the log's."""

from dataclasses import dataclass
from itertools import zip_longest
from typing import Final

from hil.bus.catalogue import FrameCatalogue
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


@dataclass(frozen=True)
class Difference:
    """A tick whose frames differ: (identifier, data) as logged and as computed."""

    tick: int
    time_s: float
    logged: tuple[tuple[int, bytes], ...]
    computed: tuple[tuple[int, bytes], ...]

    def words(self, catalogue: FrameCatalogue) -> str:
        names = catalogue.by_id()

        def shown(frame: tuple[int, bytes] | None) -> str:
            if frame is None:
                return "nothing"
            number, data = frame
            return f"{names[number].name if number in names else hex(number)} {data.hex()}"

        logged, computed = next(pair for pair in zip_longest(self.logged, self.computed) if pair[0] != pair[1])
        both = {"logged": shown(logged), "computed": shown(computed)}
        return TEXT("replay.tick", tick=self.tick, time=self.time_s, **both)


@dataclass(frozen=True)
class Replay:
    """What a replay found; the plans of `cut` ticks were cut short by the clock, and again in the replay."""

    ticks: int
    frames: int
    cut: int
    differences: tuple[Difference, ...]

    @property
    def identical(self) -> bool:
        return not self.differences
