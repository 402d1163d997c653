"""A kind of rig: one declaration of its columns, tables, drive, template and the properties that code asks."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.drives.drive import Drive
from models.rigs.columns import RANGES, Columns, Range
from models.rigs.rig import Head, Rig
from models.rigs.schema import Table
from models.rigs.tables import CapsuleTable, PaperCapsuleTable, TissueTable

Tables = Mapping[str, Mapping[str, Any]]
"""Values by table and key."""
Array = NDArray[np.float64]
Record = Mapping[str, Array]
Template = Callable[[np.random.Generator], tuple[Tables, Record]]
"""Tables of a rig file and the columns of a record, whose measured ones are the nominal model's where left out."""
IN_GUT: Mapping[str, type[Table]] = {"capsule": CapsuleTable, "tissue": TissueTable}


@dataclass(frozen=True)
class Instead:
    """`[rig.name]`: a table within `[rig]` whose `head` then has other keys."""

    name: str
    table: type[Table]
    read: Callable[[Any, str], Table]
    head: type[Head]


@dataclass(frozen=True)
class RigKind:
    """A kind of rig. Records hold the columns of one of `layouts`, in the kind's own `ranges`. A rig file has the
    `tables` (those without a key that must be there may be left out) and may have the `further` ones.
    """

    id: str
    layouts: tuple[Columns, ...]
    ranges: Mapping[str, Range] = field(default_factory=dict)
    usual: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    """Within what the greatest amount of a column is on any such rig, and the unit."""
    tables: Mapping[str, type[Table]] = field(default_factory=dict)
    further: Mapping[str, type[Table]] = field(default_factory=dict)
    head: type[Head] = Head
    instead: Instead | None = None
    nominal: Tables = field(default_factory=dict)
    """What an experimenter believes who states nothing, beside the papers' capsule and gut."""
    drive: Callable[[Rig, bool], Drive] | None = None
    """The drive of a time series of a capsule; the flag says that a record logs the coil's voltage."""
    template: Template | None = None
    """What `capsule init` writes; None: what the simulated plant of this kind gives."""
    turning_template: Template | None = None
    """The same of a rig that turns."""
    effects: frozenset[str] = frozenset()
    """Effects that can act here, by id, beside those that name this kind."""
    hooks: frozenset[str] = frozenset()
    """Hooks of an effect that are asked, beside those of a body's that moves."""
    signals: frozenset[str] | None = None
    """The signals that an effect gets; None: all of a moving body's."""
    longest_s: float = np.inf
    """Longest motion that one record may ask to be computed."""
    wanted: str = "more records, or a longer one"
    """What records lack that have no two parts to fit on and to judge by."""
    rising: tuple[str, str] | None = None
    """Two columns of which the second is above the first in every row."""
    scatters: bool = False
    """Whether rows of a table are repeats, which differ by chance alone."""
    runs: bool = False
    """Whether each row of a table is a run of `cycles` periods."""
    vibrates: bool = False
    """Whether the motion may be no slower than the sampling."""
    switched: bool = False
    """Whether the drive switches, so that it cannot be read between samples."""
    stage: bool = False
    """Whether a machine's axis moves, and no capsule."""
    drawn: bool = False
    """Whether a rig draws the capsule along and shows the force that this takes."""
    follows: bool = False
    """Whether the capsule follows a driven position."""
    pushed: bool = False
    """Whether a field pushes the capsule from anywhere."""

    @property
    def layout(self) -> Columns:
        """The columns of a record that holds none of another layout's."""
        return self.layouts[0]

    @property
    def of_capsule(self) -> bool:
        """Whether records are time series of a capsule."""
        return self.drive is not None

    @property
    def imposed(self) -> bool:
        """Whether a motion is imposed and the force is measured."""
        return self.drawn or self.stage

    @property
    def led(self) -> bool:
        """Whether the capsule is led along a path."""
        return self.drawn or self.follows

    @property
    def of_paper(self) -> bool:
        """Whether capsule and gut matter little: both are the papers' where nothing is stated."""
        return self.tables.get("capsule", PaperCapsuleTable) is PaperCapsuleTable

    @property
    def known(self) -> tuple[str, ...]:
        """Every name of a column that has a meaning, in any layout."""
        return tuple(dict.fromkeys(name for one in self.layouts for name in one.known()))

    def columns(self, names: Iterable[str]) -> Columns:
        """The layout of a record with the columns `names`: the one that has most of them."""
        there = set(names)
        return max(self.layouts, key=lambda layout: len(there & set(layout.own())))

    def range(self, name: str) -> Range | None:
        """The range of a column; None where there is none."""
        return self.ranges.get(name, RANGES.get(name))

    def first_wrong(self, name: str, values: Array) -> int | None:
        """Row of the first value out of the range of the column `name`; None where there is none."""
        limits = self.range(name)
        good = True if limits is None else limits.holds(values)
        return None if np.all(good) else int(np.argmin(good))
