"""What the experimenter believes about a rig: read from a TOML file, checked, and handed on as plain records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from models.files.columns import COLUMNS, SLOWEST_PULL, known_of
from models.files.mapping import ColumnMap, MappedColumn
from models.files.rig_tables import (
    EXAMPLES,
    Axis,
    BodyTable,
    CapsuleTable,
    Checks,
    Clock,
    Coil,
    ColumnTable,
    Contact,
    Drive,
    Magnet,
    Magnets,
    Noise,
    PaperCapsuleTable,
    PaperTissueTable,
    Positive,
    Surface,
    Table,
    TissueTable,
    range_words,
)
from models.files.tables import is_number, shown, with_contact_angle
from models.files.toml import read_toml
from models.laws.dipole import PAIRINGS
from models.laws.geometry import Capsule, Tissue
from models.parameter import nearest

TABLES = (
    "capsule",
    "tissue",
    "rig",
    "noise",
    "drive",
    "surface",
    "axis",
    "contact",
    "checks",
    "clock",
    "prior",
    "columns",
)
T = TypeVar("T", bound=Table)
_STD = "_std"


@dataclass(frozen=True)
class Rig:
    """A rig of one kind with its nominal values; a part that this kind does not have is None or the default capsule and
    gut. `prior` has the standard deviations with which nominal values of what calibration fits are known, by name.
    """

    kind: str
    capsule: Capsule = field(default_factory=Capsule)
    tissue: Tissue = field(default_factory=Tissue)
    noise: Noise = field(default_factory=Noise)
    checks: Checks = field(default_factory=Checks)
    clock: Clock | None = None
    magnet: Magnet | None = None
    magnets: Magnets | None = None
    coil: Coil | None = None
    drive: Drive | None = None
    surface: Surface | None = None
    axis: Axis = field(default_factory=Axis)
    contact: Contact = field(default_factory=Contact)
    velocity_m_s: float | None = None
    name: str = ""
    columns: ColumnMap = ColumnMap()
    prior: Mapping[str, float] = field(default_factory=dict)


class _Head(Table):
    """`[rig]` of a kind that needs nothing else there."""

    kind: str
    name: str = ""


class _MagneticHead(_Head, Magnet):
    pass


class _MagnetsHead(_Head):
    """`[rig]` of a magnetic kind with a table `[rig.magnet]`: a measured stiffness may stand beside it."""

    magnet_stiffness_N_per_m: Positive | None = None


class _CoilHead(_Head, Coil):
    pass


class _PeriodsHead(_Head):
    velocity_m_s: float | None = None


HEADS: Mapping[str, type[_Head]] = {
    **dict.fromkeys(COLUMNS, _Head),
    "magnetic": _MagneticHead,
    "coil": _CoilHead,
    "periods": _PeriodsHead,
}
"""The table `[rig]` of each kind."""
CAPSULE_SERIES = ("pull", "magnetic", "coil", "vibro")
"""Kinds whose records are time series of a capsule."""
_SWITCHED = ("coil", "vibro")


def read_rig(path: Path) -> Rig:
    """Read a rig file; anything wrong with it is a ValueError of one sentence with file, table and key."""
    path = Path(path)
    raw, _ = read_toml(path, "rig file")
    return parse_rig(raw, str(path))


def parse_rig(raw: Mapping[str, Any], where: str = "rig") -> Rig:
    """The rig that the tables of a rig file describe."""
    unknown = next((key for key in raw if key not in TABLES), None)
    if unknown is not None:
        raise ValueError(f"{where}: table must be one of a rig file; got {unknown!r}; {nearest(unknown, TABLES)}")
    for table, content in raw.items():
        if not isinstance(content, dict):
            raise ValueError(f"{where}: [{table}] must be a table; got {shown(content)}")
    kind = _kind(raw, where)
    file = _File(raw, where, kind)
    magnets = file.magnets()
    head = file.read("rig", HEADS[kind] if magnets is None else _MagnetsHead)
    rig = replace(_parts(file, kind, head), checks=file.read("checks", Checks, optional=True))
    if isinstance(head, _MagnetsHead) and magnets is not None:
        rig = replace(rig, magnets=magnets, magnet=_spring(magnets, head.magnet_stiffness_N_per_m))
    if kind in CAPSULE_SERIES and "clock" in raw:
        clock = file.read("clock", Clock)
        if clock.drift and kind in _SWITCHED:
            raise ValueError(
                f"{where}: [clock] drift must be left out for kind {kind}, whose drive switches and cannot be read"
                f" between its samples; got {clock.drift:g}"
            )
        rig = replace(rig, clock=clock)
    columns, prior = file.columns(), file.prior()
    file.refuse_rest()
    return replace(rig, columns=columns, prior=prior)


def _kind(raw: Mapping[str, Any], where: str) -> str:
    if "rig" not in raw:
        got = ", ".join(f"[{table}]" for table in raw) or "an empty file"
        raise ValueError(f"{where}: table [rig] must be there with a key 'kind'; got {got}")
    head = raw["rig"]
    if "kind" not in head:
        close = next((key for key in head if nearest("kind", [key]).startswith("did")), None)
        raise ValueError(
            f"{where}: [rig] must have the key 'kind'; "
            + (f"got {close!r}" if close else "it is missing")
            + f"; kinds: {', '.join(COLUMNS)}"
        )
    kind = head["kind"]
    if not isinstance(kind, str) or kind not in COLUMNS:
        hint = nearest(kind, dict(COLUMNS)) if isinstance(kind, str) else "known: " + ", ".join(COLUMNS)
        raise ValueError(f"{where}: [rig] kind must be a known kind of rig; got {kind!r}; {hint}")
    return kind


def _parts(file: _File, kind: str, head: _Head) -> Rig:
    noise = file.read("noise", Noise, optional=True)
    if kind == "pull":
        return Rig(kind, *file.gut(), noise, name=head.name)
    if kind in ("magnetic", "coil"):
        surface = file.read("surface", Surface) if "surface" in file.raw else None
        parts = file.on(surface)
        return Rig(
            kind, *parts, noise, magnet=_part(head, Magnet), coil=_part(head, Coil), surface=surface, name=head.name
        )
    if kind in ("vibro", "vibro_table"):
        drive, surface = file.read("drive", Drive), file.read("surface", Surface)
        return Rig(kind, *file.on(surface), noise, drive=drive, surface=surface, name=head.name)
    if kind == "periods":
        capsule = file.read("capsule", PaperCapsuleTable, optional=True).capsule()
        return Rig(
            kind, capsule, file.paper_tissue(capsule), noise, velocity_m_s=_pull_speed(file.where, head), name=head.name
        )
    capsule = file.read("capsule", PaperCapsuleTable, optional=True).capsule()
    axis = file.read("axis", Axis, optional=True) if kind == "axis" else Axis()
    contact = file.read("contact", Contact, optional=True) if kind == "friction" else Contact()
    return Rig(kind, capsule, file.paper_tissue(capsule), noise, axis=axis, contact=contact, name=head.name)


def _spring(magnets: Magnets, stiffness: float | None) -> Magnet:
    """The spring with the stiffness of two magnets (or a measured one) and their gap of greatest pull."""
    k = magnets.stiffness_N_per_m() if stiffness is None else stiffness
    return Magnet(
        magnet_stiffness_N_per_m=k,
        magnet_range_m=math.sqrt(3) * PAIRINGS[magnets.moments].peak * magnets.height_m,
    )


def at_height(rig: Rig, height_m: float) -> Rig:
    """The same rig with its magnets at another height: the stiffness goes with its inverse fifth power, the range with
    it. Raises ValueError for a rig without `[rig.magnet]`.
    """
    if rig.magnets is None or rig.magnet is None:
        raise ValueError("rig must have a table [rig.magnet] to have another height; got none")
    share = height_m / rig.magnets.height_m
    spring = Magnet(
        magnet_stiffness_N_per_m=rig.magnet.magnet_stiffness_N_per_m / share**5,
        magnet_range_m=rig.magnet.magnet_range_m * share,
    )
    return replace(rig, magnet=spring, magnets=rig.magnets.model_copy(update={"height_m": height_m}))


def read_magnets(content: Any, where: str) -> Magnets:
    """A table `[rig.magnet]`, checked. Raises ValueError of one sentence."""
    if not isinstance(content, Mapping):
        raise ValueError(f"{where}: [rig.magnet] must be a table; got {shown(content)}")
    magnets = _File({}, where, "magnetic").checked("rig.magnet", Magnets, content)
    try:
        magnets.check()
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return magnets


def _part(head: _Head, table: type[T]) -> T | None:
    return table(**{key: getattr(head, key) for key in table.model_fields}) if isinstance(head, table) else None


def _pull_speed(where: str, head: _Head) -> float | None:
    speed = head.velocity_m_s if isinstance(head, _PeriodsHead) else None
    if speed is not None and not SLOWEST_PULL <= speed <= 1:
        raise ValueError(
            f"{where}: [rig] velocity_m_s must be the speed of the pull, {SLOWEST_PULL:g} to 1 m/s; got {speed:g}"
        )
    return speed


@dataclass
class _File:
    """The tables of one rig file; remembers which were used, so that the rest is refused."""

    raw: Mapping[str, Any]
    where: str
    kind: str

    def __post_init__(self) -> None:
        self.used = {"rig"}

    def gut(self) -> tuple[Capsule, Tissue]:
        """Capsule and gut of a rig that has both."""
        capsule = self.read("capsule", CapsuleTable).capsule()
        return capsule, self._tissue(TissueTable, capsule)

    def on(self, surface: Surface | None) -> tuple[Capsule, Tissue]:
        """Body and gut of a rig whose body lies on `surface`, the gut where nothing is said."""
        if surface is None or surface.kind == "gut":
            return self.gut()
        if surface.kind == "plate" and surface.friction_coefficient is None:
            raise ValueError(
                f"{self.where}: [surface] must have the key 'friction_coefficient' where its kind is 'plate'; it is"
                " missing"
            )
        capsule = self.read("capsule", BodyTable).capsule()
        return capsule, self.paper_tissue(capsule)

    def magnets(self) -> Magnets | None:
        """`[rig.magnet]` of a magnetic rig, taken out of `[rig]`; None where there is none."""
        if self.kind != "magnetic" or "magnet" not in self.raw["rig"]:
            return None
        head = dict(self.raw["rig"])
        magnets = read_magnets(head.pop("magnet"), self.where)
        self.raw = {**self.raw, "rig": head}
        return magnets

    def paper_tissue(self, capsule: Capsule) -> Tissue:
        """The gut where it matters little: paper A's but for what is given."""
        return self._tissue(PaperTissueTable, capsule, optional=True)

    def _tissue(self, model: type[TissueTable], capsule: Capsule, optional: bool = False) -> Tissue:
        if "lumen_diameter_m" not in self.raw.get("tissue", {}):
            return self.read("tissue", model, optional).tissue()
        self.used.add("tissue")
        try:
            content = with_contact_angle(self.raw["tissue"], capsule.radius_m, "tissue")
        except ValueError as error:
            raise ValueError(f"{self.where}: {error}") from None
        return self.checked("tissue", model, content).tissue()

    def read(self, table: str, model: type[T], optional: bool = False) -> T:
        """One table, checked."""
        if table not in self.raw and not optional:
            raise ValueError(
                f"{self.where}: table [{table}] must be there for a rig of kind {self.kind!r}; it is missing"
            )
        self.used.add(table)
        return self.checked(table, model, self.raw.get(table, {}))

    def columns(self) -> ColumnMap:
        """`[columns]`: for each column of ours a table, or the name alone."""
        self.used.add("columns")
        known, entries = known_of(self.kind), list[MappedColumn]()
        for target, given in self.raw.get("columns", {}).items():
            if target not in known:
                raise ValueError(
                    f"{self.where}: [columns] key must be a column of kind {self.kind!r}; got {target!r};"
                    f" {nearest(target, known)}"
                )
            table = {"column": given} if isinstance(given, str) else given
            if not isinstance(table, dict):
                raise ValueError(
                    f"{self.where}: [columns] {target} must be the name of a column, or a table with the key 'column';"
                    f" got {given!r}"
                )
            content = self.checked(f"columns.{target}", ColumnTable, table).model_dump()
            try:
                entries.append(MappedColumn(target, **content))
            except ValueError as error:
                raise ValueError(f"{self.where}: [columns] {error}") from None
        return ColumnMap(tuple(entries))

    def prior(self) -> dict[str, float]:
        """`[prior]`: standard deviations by the name of what calibration fits, as `friction_coefficient_std`."""
        self.used.add("prior")
        content = self.raw.get("prior", {})
        for key, std in content.items():
            if not key.endswith(_STD) or not is_number(std) or not std > 0:
                raise ValueError(
                    f"{self.where}: [prior] must hold the name of a calibrated parameter with '{_STD}' and a standard"
                    f" deviation above 0; got {key} = {shown(std)}"
                )
        return {key.removesuffix(_STD): float(std) for key, std in content.items()}

    def checked(self, table: str, model: type[T], content: Mapping[str, Any]) -> T:
        """The content of a table as its model, else a ValueError of one sentence."""
        try:
            return model.model_validate(dict(content))
        except ValidationError as error:
            errors = sorted(error.errors(include_url=False), key=lambda e: e["type"] != "extra_forbidden")
            missing = [str(e["loc"][0]) for e in errors if e["type"] == "missing"]
            if errors[0]["type"] != "extra_forbidden" and missing:
                told = ValueError(f"{self.where}: {_missing(table, model, missing)}")
                if len(missing) > 1:
                    told.add_note("\n".join([f"[{table}]", *(f"{key} = {EXAMPLES[key]}" for key in missing)]))
                raise told from None
            raise ValueError(f"{self.where}: {self._sentence(table, model, errors[0])}") from None

    def refuse_rest(self) -> None:
        """Refuse tables that this kind of rig does not have."""
        for table in self.raw:
            if table not in self.used:
                raise ValueError(
                    f"{self.where}: table [{table}] must not be there for kind {self.kind!r}; it takes"
                    f" {_listed(self.used)}"
                )

    def _sentence(self, table: str, model: type[Table], error: ErrorDetails) -> str:
        key = str(error["loc"][0]) if error["loc"] else ""
        if error["type"] == "extra_forbidden":
            owner = next(
                (
                    f"{key!r}, which belongs to kind {kind!r}"
                    for kind, head in HEADS.items()
                    if table == "rig" and key in head.model_fields
                ),
                None,
            )
            missing = [name for name in model.model_fields if name not in self.raw.get(table, {})] or list(
                model.model_fields
            )
            return f"[{table}] key must be a known one; got {owner or f'{key!r}; {nearest(key, missing)}'}"
        return f"[{table}] {key} must be {_expected(error, model, key)}; got {shown(error['input'])}"


def _missing(table: str, model: type[Table], keys: Sequence[str]) -> str:
    """Every key that a table lacks, each with its range and an example."""
    told = []
    for key in keys:
        limits = [word for word in (range_words(model, key), f"such as {EXAMPLES[key]}") if word]
        told.append(f"{key!r} ({'; '.join(limits)})")
    if len(keys) == 1:
        return f"[{table}] must have the key {told[0]}; it is missing"
    return f"[{table}] must have the keys {', '.join(told)}; they are missing"


def _expected(error: ErrorDetails, model: type[Table], key: str) -> str:
    limits = error.get("ctx", {})
    if error["type"] == "literal_error":
        return f"one of {limits['expected']}"
    words = ("gt", "ge", "lt", "le")
    if any(name in words for name in limits) and key in model.model_fields:
        return range_words(model, key)
    return {"bool_type": "true or false", "string_type": "text"}.get(error["type"], "a finite number")


def _listed(tables: set[str]) -> str:
    return ", ".join(f"[{table}]" for table in TABLES if table in tables)
