"""Rig files: read from TOML and checked, as plain records."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from models.files.toml import is_number, read_toml, shown, with_contact_angle
from models.laws.geometry import Capsule, Tissue
from models.parameter import nearest
from models.rigs import tables
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.mapping import ColumnMap, MappedColumn
from models.rigs.rig import Rig
from models.rigs.schema import Table, checked
from models.words.sentences import Sentences

T = TypeVar("T", bound=Table)
TEXT: Final = Sentences(__file__)
_STD = "_std"
_BODY = ("capsule", "tissue")
_FIRST, _LAST = (*_BODY, "rig", "noise"), ("checks", "clock", "prior", "columns")
_FIELDS = frozenset(field.name for field in fields(Rig))


def read_rig(path: Path) -> Rig:
    """Read a rig file; anything wrong with it is a ValueError of one sentence with file, table and key."""
    path = Path(path)
    raw, _ = read_toml(path, "rig file")
    return parse_rig(raw, str(path))


def table_names() -> tuple[str, ...]:
    """The tables that a rig file of any kind may have."""
    kinds = KINDS.values()
    own = (name for kind in kinds for name in kind.tables)
    further = (name for kind in kinds for name in kind.further)
    return tuple(dict.fromkeys((*_FIRST, *own, *_LAST, *further)))


def parse_rig(raw: Mapping[str, Any], where: str = "rig") -> Rig:
    """The rig that the tables of a rig file describe."""
    if "record" in raw:
        return _with_records(raw, where)
    known = (*table_names(), "record")
    unknown = next((key for key in raw if key not in known), None)
    if unknown is not None:
        raise ValueError(TEXT("table", where=where, table=unknown, hint=nearest(unknown, known)))
    for table, content in raw.items():
        if not isinstance(content, dict):
            raise ValueError(f"{where}: [{table}] must be a table; got {shown(content)}")
    kind = _kind(raw, where)
    file = _File(raw, where, kind)
    parts = file.head() | {"noise": file.read("noise", tables.Noise, optional=True)}
    for name, model in kind.tables.items():
        if name not in _BODY:
            must = any(field.is_required() for field in model.model_fields.values())
            parts[name] = file.read(name, model, optional=not must)
    parts |= {name: file.read(name, model) for name, model in kind.further.items() if name in raw}
    parts["capsule"], parts["tissue"] = file.body(parts.get("surface"))
    parts["checks"] = file.read("checks", tables.ChecksTable, optional=True)
    if kind.switched and "clock" in parts and parts["clock"].drift:
        raise ValueError(TEXT("drift", where=where, kind=kind.id, drift=parts["clock"].drift))
    columns, prior = file.columns(), file.prior()
    file.refuse_rest()
    own = {name: parts.pop(name) for name in tuple(parts) if name not in _FIELDS}
    return Rig(kind.id, **parts, columns=columns, prior=prior, own=own)


def _with_records(raw: Mapping[str, Any], where: str) -> Rig:
    """The rig of a file with `[[record]]`, and those of the records that they name."""
    shared, given = {name: table for name, table in raw.items() if name != "record"}, raw["record"]
    rig, found = parse_rig(shared, where), dict[str, Rig]()
    for changes in given if isinstance(given, list) else [given]:
        file = changes.get("file") if isinstance(changes, dict) else None
        at = f"{where}: [[record]]"
        if not isinstance(file, str) or not file:
            raise ValueError(TEXT("record", at=at, got=shown(changes)))
        own = dict[str, Any](shared)
        for table, content in changes.items():
            if table != "file":
                if not isinstance(content, dict):
                    raise ValueError(f"{at} {file}: key must have its table, as capsule.mass_kg; got {table!r}")
                own[table] = {**own.get(table, {}), **content}
        found[record_name(Path(file))] = other = parse_rig(own, f"{at} {file}")
        if other.kind != rig.kind:
            raise ValueError(f"{at} {file}: kind must be that of the rig, {rig.kind}; got {other.kind!r}")
    return replace(rig, differing=found)


def record_name(path: Path) -> str:
    """The name of a record's file without its endings."""
    return re.sub(r"(?i)(\.(csv|tsv|txt))?(\.gz)?$", "", path.name, count=1) or path.name


def _kind(raw: Mapping[str, Any], where: str) -> RigKind:
    if "rig" not in raw:
        got = ", ".join(f"[{table}]" for table in raw) or "an empty file"
        raise ValueError(f"{where}: table [rig] must be there with a key 'kind'; got {got}")
    head = raw["rig"]
    if "kind" not in head:
        close = next((key for key in head if nearest("kind", [key]).startswith("did")), None)
        got = f"got {close!r}" if close else "it is missing"
        raise ValueError(TEXT("no_kind", where=where, got=got, kinds=", ".join(KINDS)))
    kind = head["kind"]
    if not isinstance(kind, str) or kind not in KINDS:
        hint = nearest(kind, KINDS) if isinstance(kind, str) else "known: " + ", ".join(KINDS)
        raise ValueError(f"{where}: [rig] kind must be a known kind of rig; got {kind!r}; {hint}")
    return KINDS["driven_axis"] if kind == "axis" and head.get("driven") else KINDS[kind]


@dataclass
class _File:
    """The tables of one rig file, and which of them were used: the rest is refused."""

    raw: Mapping[str, Any]
    where: str
    kind: RigKind

    def __post_init__(self) -> None:
        self.used = {"rig"}

    def head(self) -> dict[str, Any]:
        """The values of `[rig]` and of a table within it."""
        content, nested, instead = dict(self.raw["rig"]), None, self.kind.instead
        if instead is not None and instead.name in content:
            nested = instead.read(content.pop(instead.name), self.where)
        head = self.kind.head if nested is None or instead is None else instead.head
        owners = {key: kind.id for kind in reversed(KINDS.values()) for key in kind.head.model_fields}
        return checked(self.where, "rig", head, content, owners).parts(nested)

    def body(self, surface: tables.SurfaceTable | None) -> tuple[Capsule, Tissue]:
        """Body and gut of a rig on `surface` (None: the gut), the papers' where a kind has no table of its own."""
        paper = self.kind.tables.get("capsule", tables.PaperCapsuleTable) is tables.PaperCapsuleTable
        gut = surface is None or surface.kind == "gut"
        body = tables.PaperCapsuleTable if paper else tables.CapsuleTable if gut else tables.BodyTable
        capsule = self.read("capsule", body, optional=paper).capsule()
        if paper or not gut:
            return capsule, self._tissue(tables.PaperTissueTable, capsule, optional=True)
        return capsule, self._tissue(tables.TissueTable, capsule)

    def _tissue(self, model: type[tables.TissueTable], capsule: Capsule, optional: bool = False) -> Tissue:
        if "lumen_diameter_m" not in self.raw.get("tissue", {}):
            return self.read("tissue", model, optional).tissue()
        self.used.add("tissue")
        try:
            content = with_contact_angle(self.raw["tissue"], capsule.radius_m)
        except ValueError as error:
            raise ValueError(f"{self.where}: {error}") from None
        return checked(self.where, "tissue", model, content).tissue()

    def read(self, table: str, model: type[T], optional: bool = False) -> T:
        """One table, checked."""
        if table not in self.raw and not optional:
            raise ValueError(TEXT("missing", where=self.where, table=table, kind=self.kind.id))
        self.used.add(table)
        return checked(self.where, table, model, self.raw.get(table, {}))

    def columns(self) -> ColumnMap:
        """`[columns]`: for each column of ours a table, or the name alone."""
        self.used.add("columns")
        known, entries = self.kind.known, list[MappedColumn]()
        for target, given in self.raw.get("columns", {}).items():
            if target not in known:
                hint = nearest(target, known)
                raise ValueError(TEXT("columns.key", where=self.where, kind=self.kind.id, target=target, hint=hint))
            table = {"column": given} if isinstance(given, str) else given
            if not isinstance(table, dict):
                raise ValueError(TEXT("columns.value", where=self.where, target=target, given=given))
            content = checked(self.where, f"columns.{target}", tables.ColumnTable, table).model_dump()
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
                raise ValueError(TEXT("prior", where=self.where, ending=_STD, key=key, got=shown(std)))
        return {key.removesuffix(_STD): float(std) for key, std in content.items()}

    def refuse_rest(self) -> None:
        """Refuse tables that this kind of rig does not have."""
        for table in self.raw:
            if table not in self.used:
                listed = ", ".join(f"[{name}]" for name in table_names() if name in self.used)
                raise ValueError(TEXT("strange", where=self.where, table=table, kind=self.kind.id, listed=listed))
