"""One line of the comparison: what a paper states, what its equations give, what was measured, and the verdict."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

Verdict = Literal[
    "reproduced", "consistent", "check value", "not comparable",
    "misprint", "not reproducible", "misses the measurement", "finding",
]  # fmt: skip
# how many of a unit an SI unit is
_PER_SI = {"1": 1.0, "%": 100.0, "s": 1.0, "mm": 1e3, "mm/s": 1e3, "mN": 1e3, "N": 1.0, "Pa": 1.0, "MPa": 1e-6}


@dataclass(frozen=True)
class Row:
    """A number in `unit`: what the `paper` states, `computed` from its equations, `measured` where it is printed."""

    id: str
    quantity: str
    unit: str
    paper: float | None
    computed: float
    measured: float | None
    verdict: Verdict
    note: str

    def record(self) -> dict[str, object]:
        """The row as a JSON object."""
        return asdict(self)


def row(
    key: str,
    quantity: str,
    unit: str,
    computed: float,
    verdict: Verdict,
    note: str = "",
    paper: float | None = None,
    measured: float | None = None,
) -> Row:
    """A `Row` from numbers in SI, shown in `unit`."""
    scale = _PER_SI[unit]
    stated, seen = (None if value is None else float(value) * scale for value in (paper, measured))
    return Row(key, quantity, unit, stated, float(computed) * scale, seen, verdict, note)


def rows(paper: str, *lines: tuple[Any, ...]) -> list[Row]:
    """A `row` of each line, whose first two entries follow the letter of the paper that they are about."""
    return [row(f"{paper.lower()}_{key}", f"{paper}: {quantity}", *told) for key, quantity, *told in lines]


def speed_key(speed_m_s: float) -> str:
    """A speed as part of an id: 0.5 mm/s becomes `0_5_mm_s`."""
    return f"{speed_m_s * 1e3:g}".replace(".", "_") + "_mm_s"
