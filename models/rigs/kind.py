"""A kind of rig: one declaration of its columns, tables, drive, template and properties."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.drives.drive import Drive
from models.rigs.columns import RANGES, Columns, Range
from models.rigs.rig import Head, Rig
from models.rigs.schema import Table
from models.rigs.tables import CapsuleTable, TissueTable
from models.surfaces.surface import Surface

Tables = Mapping[str, Mapping[str, Any]]
"""Values by table and key."""
Array = NDArray[np.float64]
Record = Mapping[str, Array]
Template = Callable[[np.random.Generator], tuple[Tables, Record]]
"""Tables of a rig file and the columns of a record; measured ones that are left out are the nominal model's."""
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
    `tables` (those without a required key may be left out) and may have the `further` ones.
    """

    id: str
    layouts: tuple[Columns, ...]
    ranges: Mapping[str, Range] = field(default_factory=dict)
    usual: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    """Usual range of a column's greatest amount on such a rig, and the unit."""
    tables: Mapping[str, type[Table]] = field(default_factory=dict)
    further: Mapping[str, type[Table]] = field(default_factory=dict)
    head: type[Head] = Head
    instead: Instead | None = None
    nominal: Tables = field(default_factory=dict)
    """Nominal values where nothing is stated, in addition to the papers' capsule and gut."""
    drive: Callable[[Rig, bool], Drive] | None = None
    """The drive of a time series of a capsule; the flag says that a record logs the coil's voltage."""
    template: Template | None = None
    """What `capsule init` writes; None: what the simulated plant of this kind gives."""
    turning_template: Template | None = None
    """The same of a rig that turns."""
    effects: frozenset[str] = frozenset()
    """Effects that can act here, by id, in addition to those that name this kind."""
    hooks: frozenset[str] = frozenset()
    """Hooks of an effect that are called, in addition to those of a moving body."""
    signals: frozenset[str] | None = None
    """The signals that an effect gets; None: all of a moving body's."""
    longest_s: float = np.inf
    """Longest motion that one record may ask to be computed."""
    wanted: str = "more records, or a longer one"
    """What to add to records that have no two parts, one to fit and one to validate."""
    rising: tuple[str, str] | None = None
    """Two columns of which the second is above the first in every row."""
    scatters: bool = False
    """Whether rows of a table are repeats, which differ only by chance."""
    runs: bool = False
    """Whether each row of a table is a run of `cycles` periods."""
    vibrates: bool = False
    """Whether the motion may be as fast as the sampling."""
    switched: bool = False
    """Whether the drive switches, so that it cannot be read between samples."""
    stage: bool = False
    """Whether a machine's axis moves, and no capsule."""
    surface: Callable[[Rig], Surface] | None = None
    """What its body lies on, where the rig file does not say."""
    may_drive: tuple[str, ...] = ()
    """Columns that drive it, where its records are then of another kind."""
    turned: str = ""
    """The kind that a rig file names and that is this one where `[rig] driven` is one of its driven columns."""
    drawn: bool = False
    """Whether a rig draws the capsule along and shows the force that this takes."""
    follows: bool = False
    """Whether the capsule follows a driven position."""
    pushed: bool = False
    """Whether a field pushes the capsule at any position."""

    @property
    def layout(self) -> Columns:
        """The default columns of a record."""
        return self.layouts[0]

    @property
    def of_capsule(self) -> bool:
        """Whether records are time series of a capsule."""
        return self.drive is not None

    @property
    def imposed(self) -> bool:
        """Whether a motion is imposed and the force is measured."""
        return self.drawn or (self.stage and self.drive is None)

    @property
    def led(self) -> bool:
        """Whether the capsule is led along a path."""
        return self.drawn or self.follows

    @property
    def known(self) -> tuple[str, ...]:
        """Every name of a column that has a meaning, in any layout."""
        return tuple(dict.fromkeys((*(name for one in self.layouts for name in one.known()), *self.may_drive)))

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
