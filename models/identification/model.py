"""An identified model: parameter values for each stage, kept in TOML, and its free-running prediction."""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, Strict, StringConstraints, ValidationError

from models.assembly.model import effect_parameters
from models.effects import CATALOGUE, REFINEMENTS, Catalogue
from models.files.access import read_json, read_text
from models.files.toml import in_file, parse_toml, shown, toml_text
from models.identification.finding import STAGES
from models.identification.kinds import kind_for, ready
from models.identification.kinds.series.drive_input import SWITCH_DELAY, read_late
from models.identification.record_checks import check_demand
from models.identification.validity import Ranges, beyond, ranges_of
from models.parameter import Parameter, nearest
from models.records.record import Record, named
from models.rigs.columns import FURTHER
from models.rigs.kinds import KINDS
from models.rigs.kinds import named as named_in_file
from models.rigs.rig import Rig
from models.rigs.schema import Table
from models.theta import Theta, spelled

LARGEST_MODEL = 1 << 22  # bytes of a model file
LARGEST_REPORT = 1 << 26  # bytes of a report


def read_model(path: Path, kind: str, *others: str, whole: bool = True, catalogue: Catalogue = CATALOGUE) -> Model:
    """The model of a file, for rigs of `kind` or one of the `others`, with effects of the `catalogue`; a ValueError of
    one sentence where it is none. A caller that checks later that it is `whole` can report other errors first.
    """
    text = read_text(path, "model", LARGEST_MODEL)
    with in_file(path):
        model = Model.from_toml(text, catalogue)
        if whole:
            model.check_whole()
        if not model.sealed:
            _note_unsealed(path)
        if named_in_file(model.kind) not in map(named_in_file, (kind, *others)):
            wanted = " or ".join((kind, *others))
            raise ValueError(f"model must be one of a {wanted} rig; got one of a {model.kind} rig")
    return model


def read_report(path: Path) -> dict[str, Any]:
    """The object of a report.json. Raises ValueError of one sentence."""
    return read_json(path, "report that close-loop wrote", LARGEST_REPORT)


DRAW = "draw_"  # begins the name of a possible model that differs from the last stage by its numbers alone
CLASS = "class"  # the possible model that is the mean of a class
FORMAT = 1  # of the model file, which a reader asks for
CHECKSUM = "checksum"
SEAL = "'python -m models.identification.seal MODEL.toml'"
HELD_OUT = "held_out_error"
"""The name of the error on held-out records among the values that a controller is given."""


_Stage = Annotated[str, StringConstraints(pattern=f"^({'|'.join(STAGES)})$")]


class _Push(Table):
    """The force that a model leaves unexplained."""

    force_N: Annotated[float, Field(gt=0)]
    time_s: Annotated[float, Field(gt=0)]


class _ModelFile(Table):
    """A model file."""

    model_config = ConfigDict(extra="ignore")
    kind: str
    verdict: str = ""
    provenance: dict[str, Any] = Field(default_factory=dict)
    held_out: dict[_Stage, Annotated[float, Field(ge=0)]] = Field(default_factory=dict)
    cautions: dict[_Stage, str] = Field(default_factory=dict)
    barred: dict[_Stage, str] = Field(default_factory=dict)
    refuted: dict[_Stage, str] = Field(default_factory=dict)
    possible: dict[str, dict[str, float]] = Field(default_factory=dict)
    unexplained: dict[str, _Push] = Field(default_factory=dict)
    own_effects: dict[str, dict[str, str]] = Field(default_factory=dict)
    validity: dict[str, Annotated[tuple[float, float], Strict(False)]] = Field(default_factory=dict)
    nominal: dict[str, float]
    calibrated: dict[str, float]
    augmented: dict[str, float]


@dataclass(frozen=True)
class Model:
    """`stages` maps nominal, calibrated and augmented to values.
    `held_out` maps them to the error of the free-running prediction of held-out records, in the measured column's unit;
    empty where none were held out; `cautions` name a stage that errs more there than an earlier one.
    `possible` are further models that the records leave possible, by name: the effects of a class, their mean, then
    draws from the intervals. A controller chooses among all; `barred` says why a stage must not lead, `refuted` why the
    records exclude it, and `unexplained` which random force each lacks: `force_N` rms, alike over `time_s`.
    `validity` has the range of each signal that the training records covered; empty in a file that has none.
    `own_effects` names file and SHA-256 of each effect from outside that it uses. It is not `sealed` where its file
    has no checksum; `misfit` says what is wrong where the checksum is that of another content.
    """

    kind: str
    stages: Mapping[str, Theta]
    verdict: str = ""
    provenance: dict[str, str] = field(default_factory=dict)
    held_out: Mapping[str, float] = field(default_factory=dict)
    own_effects: dict[str, dict[str, str]] = field(default_factory=dict)
    cautions: Mapping[str, str] = field(default_factory=dict)
    barred: Mapping[str, str] = field(default_factory=dict)
    refuted: Mapping[str, str] = field(default_factory=dict)
    possible: Mapping[str, Theta] = field(default_factory=dict)
    unexplained: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    validity: Ranges = field(default_factory=dict)
    sealed: bool = field(default=True, compare=False)
    misfit: str = field(default="", compare=False)

    @property
    def chooses(self) -> bool:
        """Whether the file carries a choice of what leads."""
        return bool(self.possible or self.barred)

    @property
    def members(self) -> tuple[str, ...]:
        """The `possible` models with another effect of a class, which may lead as a stage may."""
        return tuple(name for name in self.possible if not name.startswith(DRAW))

    def believed(self, stage: str) -> Theta:
        """The values of a stage or possible model for a controller, with its held-out error as `HELD_OUT` where that is
        known; that of a possible model is the last stage's, from which the records do not tell it.
        """
        known, last = self.held_out, STAGES[-1]
        error = known.get(last if stage in self.possible else stage)
        values = self.possible.get(stage) or self.stages[stage]
        return values if error is None else values | {HELD_OUT: error}

    def to_toml(self) -> str:
        """The model as a file; `from_toml` reads it back exactly."""
        tables = ("provenance", "held_out", "cautions", "barred", "refuted", "own_effects", "validity", "unexplained")
        content: dict[str, Any] = {"format": FORMAT, "kind": self.kind, "verdict": self.verdict}
        text = toml_text(content | {name: getattr(self, name) for name in tables if getattr(self, name)})
        values = {**self.stages, **{f"possible.{name}": one for name, one in self.possible.items()}}
        for table, theta in values.items():
            lines = (f"{json.dumps(spelled(name))} = {value!r}\n" for name, value in theta.items())
            text += f"[{table}]\n{''.join(lines)}\n"
        return sealed(text)

    @classmethod
    def from_toml(cls, text: str, catalogue: Catalogue = CATALOGUE) -> Model:
        """Read a model file with effects of the `catalogue`; a ValueError of one sentence where it is none."""
        raw = parse_toml(text, "model")
        if raw.get("format") != FORMAT or not isinstance(raw.get("kind"), str):
            raise ValueError(
                f"model must have 'format' = {FORMAT} and a 'kind', as close-loop writes it; got {sorted(raw)[:6]}"
            )
        try:
            file = _ModelFile.model_validate(raw)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            table, *keys = (str(part) for part in first["loc"])
            at = " ".join([f"[{table}]", *keys])
            raise ValueError(f"model {at}: {first['msg'].lower()}; got {shown(first['input'])}"[:200]) from None
        _check_own_effects(file.own_effects, catalogue)
        stages = {stage: _values(getattr(file, stage), stage, file.kind, catalogue) for stage in STAGES}
        provenance = {key: str(value) for key, value in file.provenance.items()}
        possible = {
            name: _values(values, f"possible.{name}", file.kind, catalogue) for name, values in file.possible.items()
        }
        made: dict[str, Any] = {"stages": stages, "provenance": provenance, "possible": possible}
        as_read = file.model_dump(exclude={*STAGES, *made})
        return cls(**made, **as_read, sealed=CHECKSUM in raw, misfit=_misfit(raw))

    def check_whole(self) -> None:
        """Raises ValueError where its file has the checksum of another content."""
        if self.misfit:
            raise ValueError(self.misfit)

    def predict(self, rig: Rig, record: Record, stage: str = "augmented") -> dict[str, NDArray[np.float64]]:
        """The measured columns as this model predicts them from the driven ones (and where a driven body begins)."""
        if stage not in self.stages:
            raise ValueError(f"stage must be one of {', '.join(STAGES)}; got {stage!r}; {nearest(stage, STAGES)}")
        shown = record.without(record.layout.measured)
        check_demand(shown)
        kind, columns = kind_for(rig, [shown]), dict[str, NDArray[np.float64]]()
        with named(record):
            for one in map(kind.alone, kind.channels):
                columns |= one.columns(shown, one.predict(one.driven(record), self.stages[stage]))
        return columns

    def errors(self, rig: Rig, record: Record, stage: str = "augmented") -> dict[str, tuple[float, str, str]]:
        """Error, unit and measure of the prediction of each measured column, as `close-loop` reports them."""
        record = ready(record, rig)
        kind, found = kind_for(rig, [record]), dict[str, tuple[float, str, str]]()
        for one in map(kind.alone, (column for column in kind.channels if column in record.columns)):
            value = float(one.error([record], one.predictions(record, [self.stages[stage]])))
            found[one.quantity] = (value, one.error_unit, one.measure)
        return found

    def beyond(self, rig: Rig, record: Record, predicted: Mapping[str, NDArray[np.float64]]) -> dict[str, Any]:
        """Where `record` with its `predicted` columns leaves what the training records covered."""
        driven = record.without(record.layout.measured)
        kind = kind_for(rig, [driven])
        return beyond(self.validity, ranges_of(kind, [driven], predicted)) if self.validity else {}

    def check(self, rig: Rig, record: Record) -> None:
        """Refuse values that are not those of `rig` driven as in `record`: every stage and possible model must have the
        base's parameters, no other, and those of effects that can act on it, all within their bounds. Raises ValueError
        of one sentence.
        """
        kind = kind_for(rig, [record.without(record.layout.measured)])
        # the delay of a switch is bounded by a sample of the records that it was found on
        base = [replace(p, upper=np.inf) if p.name == SWITCH_DELAY else p for p in kind.base]
        # other records of the rig may have other further columns
        late = [p for name in record.layout.beside for p in read_late(FURTHER[name], rig.clock)]
        effects = {effect.id: effect for effect in (*kind.effects, *REFINEMENTS)}
        possible = {f"possible.{name}": values for name, values in self.possible.items()}
        for stage, values in {**self.stages, **possible}.items():
            must = f"[{stage}] must have effects that can act on a rig of kind {kind.name}"
            _refuse_strange(must, values.effects, [*effects])
            declared = effect_parameters([effects[name] for name in values.effects])
            if KINDS[rig.kind].stage:
                declared = of_any_size(declared)
            # of several logged loads some may have no part in an effect
            own = [(p, p.fit and not ("per_" in p.name and effects[p.effect].loaded())) for p in declared]
            _check_values(stage, values, [*((p, p not in late) for p in base), *((p, False) for p in late), *own])


def sealed(text: str) -> str:
    """A model file's text with the checksum of its content, comments and order apart. Raises ValueError for no TOML."""
    line = f'{CHECKSUM} = "{_checksum(parse_toml(text, "model"))}"'
    bare = re.sub(rf"^{CHECKSUM}\s*=.*\n", "", text, count=1, flags=re.MULTILINE)
    return f"{line}\n{bare}"


def _checksum(raw: Mapping[str, Any]) -> str:
    content = {key: value for key, value in raw.items() if key != CHECKSUM}
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:16]


def _misfit(raw: Mapping[str, Any]) -> str:
    """A sentence where a model file has the checksum of another content; else ""."""
    if CHECKSUM not in raw or raw[CHECKSUM] == _checksum(raw):
        return ""
    return (
        f"model must be whole, as it was written with checksum {shown(raw[CHECKSUM])}; got content of"
        f" {_checksum(raw)!r}: it is cut off or damaged, or was changed by hand: then {SEAL} seals it anew"
    )


@cache
def _note_unsealed(path: Path) -> None:
    """Said once on standard error."""
    print(f"{path}: model carries no checksum, so it cannot be checked for damage; {SEAL} adds one", file=sys.stderr)


def of_any_size(parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """The `parameters` of an axis. Bounds of an effect's, but for shares, go by the size of the records that it was
    found on, and are left out.
    """
    sized = (bool(p.effect) and p.unit != "1" for p in parameters)
    return tuple(replace(p, lower=-np.inf, upper=np.inf) if s else p for p, s in zip(parameters, sized, strict=True))


def _check_values(stage: str, values: Theta, declared: Sequence[tuple[Parameter, bool]]) -> None:
    """`values` against parameters, each with whether it must be there."""
    known = [spelled(p.key) for p, _ in declared]
    missing = [spelled(p.key) for p, _ in declared if p.key not in values]
    _refuse_strange(f"[{stage}] must have parameters of its rig and effects", map(spelled, values), known, missing)
    for p, needed in declared:
        name, value = spelled(p.key), values.get(p.key)
        if value is None and needed:
            raise ValueError(f"model [{stage}] must have the key {name!r}; it is missing")
        if value is not None and not p.holds(value):
            raise ValueError(f"model [{stage}] {name} must lie in [{p.lower:g}, {p.upper:g}] {p.unit}; got {value:g}")


def own_effects_of(thetas: Mapping[str, Theta], catalogue: Catalogue) -> dict[str, dict[str, str]]:
    """File and SHA-256 of each effect from outside that the values of a model name."""
    used = {name for theta in thetas.values() for name in theta.effects}
    return {o.effect.id: {"file": o.file, "sha256": o.sha256} for o in catalogue.own if o.effect.id in used}


def _check_own_effects(named: Mapping[str, Mapping[str, str]], catalogue: Catalogue) -> None:
    """The effects from outside that a model file names must be in use with the same content."""
    known = {origin.effect.id: origin.sha256 for origin in catalogue.own}
    for name, origin in named.items():
        file, digest = origin.get("file", ""), origin.get("sha256", "")
        if name not in known:
            wanted = f"--effects {file} (SHA-256 {digest[:12]})"
            raise ValueError(f"model must stand with {wanted}, for its effect {name!r}; got no such file")
        if known[name] != digest:
            raise ValueError(
                f"model must be used with the {file} that its effect {name!r} was found with (SHA-256 {digest[:12]});"
                f" got another ({known[name][:12]})"
            )


def _values(raw: Mapping[str, float], stage: str, kind: str, catalogue: Catalogue) -> Theta:
    theta = Theta.read(raw)
    for effect, values in theta.effects.items():
        _refuse_strange(f"[{stage}] must name known effects", [effect], [*catalogue])
        if kind not in KINDS or not KINDS[kind].stage:  # an axis has them in units and columns of its own
            known = [p.name for p in catalogue[effect].parameters()]
            _refuse_strange(f"[{stage}] {effect} must have parameters of that effect", values, known)
    return theta


def _refuse_strange(must: str, names: Iterable[str], known: Sequence[str], hints: Sequence[str] = ()) -> None:
    """Refuse the first of `names` that is not `known`, with the nearest of `hints` or of those known."""
    for name in names:
        if name not in known:
            raise ValueError(f"model {must}; got {name!r}; {nearest(name, [*(hints or known)])}")
