"""A model that the loop found: parameter values for each stage, kept in TOML, and its free-running prediction."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from models.columns import COLUMNS
from models.effects import BY_ID
from models.identification.kinds import kind_for
from models.identification.result import STAGES
from models.parameter import nearest
from models.record import Record
from models.rig import Rig

FORMAT = 1


@dataclass(frozen=True)
class Model:
    """`stages` maps nominal, calibrated and augmented to values: base parameters by name, effects' as `effect_id.name`."""

    kind: str
    stages: dict[str, dict[str, float]]
    verdict: str = ""
    provenance: dict[str, str] = field(default_factory=dict)

    def to_toml(self) -> str:
        """The model as a file; `from_toml` reads it back exactly."""
        lines = [f"format = {FORMAT}", f"kind = {json.dumps(self.kind)}", f"verdict = {json.dumps(self.verdict)}", ""]
        if self.provenance:
            lines += ["[provenance]", *(f"{key} = {json.dumps(value)}" for key, value in self.provenance.items()), ""]
        for stage in STAGES:
            lines += [f"[{stage}]", *(f"{json.dumps(name)} = {value!r}" for name, value in self.stages[stage].items()), ""]
        return "\n".join(lines)

    @classmethod
    def from_toml(cls, text: str) -> Model:
        """Read a model file; a ValueError of one sentence where it is none."""
        try:
            raw = tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise ValueError(f"model must be TOML; got: {' '.join(str(error).split())[:200]}") from None
        if raw.get("format") != FORMAT or not isinstance(raw.get("kind"), str):
            raise ValueError(f"model must have 'format' = {FORMAT} and a 'kind', as close-loop writes it; got {sorted(raw)[:6]}")
        stages = {stage: _values(raw.get(stage), stage) for stage in STAGES}
        provenance = raw.get("provenance", {})
        if not isinstance(provenance, dict):
            raise ValueError(f"model must have a table [provenance]; got {provenance!r}")
        return cls(raw["kind"], stages, str(raw.get("verdict", "")), {str(k): str(v) for k, v in provenance.items()})

    def predict(self, rig: Rig, record: Record, stage: str = "augmented") -> dict[str, NDArray[np.float64]]:
        """The measured columns as this model predicts them from the driven columns of `record` alone."""
        if stage not in self.stages:
            raise ValueError(f"stage must be one of {', '.join(STAGES)}; got {stage!r}; {nearest(stage, STAGES)}")
        driven = record.without(COLUMNS[rig.kind].measured)
        kind = kind_for(rig, [driven])
        unknown = [name for name in self.stages[stage] if "." not in name and name not in {p.name for p in kind.base}]
        if unknown:
            known = [p.name for p in kind.base]
            raise ValueError(f"model must have parameters of a {kind.name} rig; got {unknown[0]!r}; {nearest(unknown[0], known)}")
        return kind.columns(driven, kind.predict(driven, self.stages[stage]))


def _values(raw: object, stage: str) -> dict[str, float]:
    if not isinstance(raw, Mapping):
        raise ValueError(f"model must have a table [{stage}]; it is missing")
    out = {}
    for name, value in raw.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise ValueError(f"model [{stage}] {name} must be a finite number; got {value!r}")
        if "." in name and name.split(".")[0] not in BY_ID:
            raise ValueError(f"model [{stage}] must name known effects; got {name!r}; {nearest(name.split('.')[0], list(BY_ID))}")
        out[str(name)] = float(value)
    return out
