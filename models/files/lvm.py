"""LabVIEW measurement files (`.lvm`) as tables: the names, a row of units, and the samples of all segments."""

from collections.abc import Iterator
from itertools import count
from typing import Final

_END: Final = "***End_of_Header***"
_X: Final = "X_Value"
Line = tuple[int, str]


def as_table(where: str, lines: Iterator[Line]) -> Iterator[Line]:
    """The numbered lines of a table between tabs. A column `X_Value` that the file leaves empty is filled by its `X0`
    and `Delta_X`; the comments at the ends of rows are left out. Raises ValueError where a segment has fewer samples
    than it states, or channels with clocks of their own.
    """
    separator, named = "\t", False
    stated: dict[str, list[str]] = {}
    for number, line in lines:
        cells = [cell.strip() for cell in line.split(separator)]
        if cells[0] == "Separator" and len(cells) == 1:
            separator, cells = ",", ["Separator", ""]
        if cells[0] == _END and "Channels" in stated:
            names = [cell.strip() for cell in next(lines, (number, ""))[1].split(separator)]
            names = names[:-1] if names[-1] == "Comment" else names
            if not named:
                units = iter(stated.get("Y_Unit_Label", []))
                time = "s" if "Time" in stated.get("X_Dimension", []) else ""
                row = [time if name == _X else next(units, "") or "-" for name in names]
                yield from ((number, "\t".join(cells)) for cells in (names, row))
            named = True
            yield from _samples(where, lines, separator, names, stated)
            stated = {"Channels": []}
        else:
            stated[cells[0]] = cells[1:]


def _samples(
    where: str, lines: Iterator[Line], separator: str, names: list[str], stated: dict[str, list[str]]
) -> Iterator[Line]:
    """The rows until the header of the next segment."""
    most = max((int(cell) for cell in stated.get("Samples", []) if cell.isdigit()), default=0)
    first, step = (float((stated.get(key) or ["0"])[0].replace(",", ".") or 0) for key in ("X0", "Delta_X"))
    for k in count():
        number, line = next(lines, (0, ""))
        cells = [cell.strip() for cell in line.split(separator)]
        if not number or cells[0] == "Channels":
            if k < most:
                raise ValueError(f"{where}: record must hold the {most} samples that it states; got {k}: it is cut off")
            return
        cells = [*cells, *[""] * len(names)][: len(names)]
        clocks = [cell for cell, name in zip(cells, names, strict=True) if name == _X and cell]
        if len(set(clocks)) > 1:
            raise ValueError(
                f"{where}, line {number}: all channels must have one {_X}; got {clocks[0]} and {clocks[-1]}: save one"
                " file for each clock, or resample"
            )
        if names[0] == _X and not cells[0] and step:
            cells[0] = repr(first + k * step)
        yield number, "\t".join(cells)
