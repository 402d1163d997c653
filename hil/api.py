"""The program from Python: rigs and records in, findings, models and predictions out, as arrays.

Nothing is printed. `progress` may be left out, else it is called with a sentence and a share from 0 to 1. What cannot
be used is a ValueError of one sentence. The same input and seed give the same numbers.

```python
from hil import api

rig = api.load_rig("rig.toml")
train = [api.load_record(f"pull_{k}.csv", rig) for k in (1, 2)]
held_out = api.load_record("held_out.csv", rig)
found = api.identify(rig, train, [held_out])
print(found.finding.verdict, [effect.id for effect in found.finding.effects], found.finding.error["holdout"])
found.write("out")  # report.html with its figures, report.json, model.toml
model = api.load_model("out/model.toml", rig.kind)
force_N = api.predict(model, rig, held_out)["force_N"]
print("rms of the rest in mN:", 1e3 * float((held_out["force_N"] - force_N).std()))
```

These lines run in `examples/own_record`. For a figure of your own, each of `found.finding.traces` has the arrays
`abscissa`, `measured` and `predicted[stage]` of a record.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from controller.choice.choose import Progress
from controller.registry import use_controllers
from controller.signals import Array
from hil.app.close_loop import result_files
from hil.app.effects import described
from hil.app.scenario.chosen import Believed, leading_of
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.scenario.scenario import load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import document, score
from hil.app.write import check_folder, write_files
from hil.log.rig_record import read_rig_record
from hil.report.numbers import report_json
from models.effects import CATALOGUE, Catalogue
from models.identification import Model, close
from models.identification.finding import Finding
from models.identification.model import read_model
from models.records.record import Record, record_of
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from plant.experiments.scenario import load_scenario, record_scenario

__all__ = [
    "Finding",
    "Identified",
    "Model",
    "Record",
    "Rig",
    "Run",
    "effects",
    "identify",
    "load_model",
    "load_record",
    "load_rig",
    "make_record",
    "make_rig",
    "predict",
    "simulate",
    "track",
    "use_controllers",
    "use_effects",
]
_in_use = CATALOGUE


@dataclass(frozen=True)
class Identified:
    """What `identify` found: the `finding` (verdict, effects, errors, intervals, traces) and the better `model`."""

    finding: Finding
    model: Model

    def report(self) -> dict[str, Any]:
        """The numbers of `report.json`."""
        return report_json(self.finding)

    def write(self, folder: str | Path) -> list[Path]:
        """Write `report.html`, `report.json` and `model.toml` to `folder`, all or none; their paths."""
        out = check_folder(Path(folder), "folder")
        files = {out / name: content for name, content in result_files(self.finding, self.model).items()}
        write_files(files)
        return list(files)


@dataclass(frozen=True)
class Run:
    """A closed loop in simulation: `scores` as `capsule track --json` prints them; `columns` of one length n, a value a
    tick: `t_s`, `command` (the drive's unit), `estimate_m` and `reference_m`.
    """

    scores: dict[str, Any]
    columns: dict[str, Array]


def load_rig(path: str | Path) -> Rig:
    """The rig of a rig or deployment file."""
    return _in_use.given_to(read_deployed_rig(Path(path)))


def make_rig(tables: Mapping[str, Mapping[str, Any]]) -> Rig:
    """The rig of the tables that a rig file would have, as `{"rig": {"kind": "pull"}, ...}`."""
    return _in_use.given_to(parse_rig(tables))


def load_record(path: str | Path, rig: Rig) -> Record:
    """A record of `rig` from a CSV file, a CAN log, or a file of one of the formats that `capsule convert` reads."""
    return read_rig_record(Path(path), rig)


def make_record(columns: Mapping[str, ArrayLike] | Any, rig: Rig, name: str = "record") -> Record:
    """A record of `rig` from arrays by column name, or from a pandas or polars frame; checked as a file would be.

    Columns have one length n; names and units are those of record files (`t_s`, `position_m`, ...).
    """
    names = [str(column) for column in (columns.keys() if isinstance(columns, Mapping) else columns.columns)]
    arrays = {column: np.asarray(columns[column], dtype=float) for column in names}
    return record_of(name, arrays, rig)


def identify(
    rig: Rig,
    train: Sequence[Record],
    holdout: Sequence[Record] = (),
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> Identified:
    """Calibrate the model of `rig` on the records `train`, find what it lacks, and judge it on `holdout`, which no fit,
    search or threshold touches.
    """
    with contextlib.redirect_stdout(io.StringIO()):
        return Identified(*close(_in_use.given_to(rig), list(train), list(holdout), progress or _silent, seed=seed))


def load_model(path: str | Path, kind: str) -> Model:
    """A `model.toml` of a rig of `kind`."""
    return read_model(Path(path), kind, catalogue=_in_use)


def predict(model: Model, rig: Rig, record: Record, stage: str = "augmented") -> dict[str, Array]:
    """The measured columns as `model` predicts them free-running from the driven columns of `record` alone; `stage` is
    nominal, calibrated or augmented. Columns of one length n, the record's for a time series.
    """
    rig = _in_use.given_to(rig)
    model.check(rig, record)
    return model.predict(rig, record, stage)


def simulate(scenario: str | Path) -> dict[str, Array]:
    """The plant of a scenario file alone: the columns of the record that its sensors give, each of length n."""
    return dict(record_scenario(load_scenario(Path(scenario))))


def track(
    scenario: str | Path,
    controller: str | None = None,
    model: str | Path | None = None,
    *,
    stage: str | None = None,
    seed: int | None = None,
    progress: Progress | None = None,
) -> Run:
    """A closed loop in simulation over the scenario file: `controller` by name, else the scenario's; the controller
    knows nominal values or those of the file `model`.
    """
    file = load_track_scenario(Path(scenario)).knowing(_in_use)
    number = file.seed if seed is None else seed
    bar = contextlib.nullcontext[Progress](progress or _silent)
    with contextlib.redirect_stdout(io.StringIO()):
        learned = None if model is None else Path(model)
        believed = Believed(partial(believed_model, file))
        leading = leading_of(learned, stage, controller, file, _in_use, believed, lambda _: bar)
        name, others = leading.controller, leading.beside(believed)
        trace = run_loop(file, believed(leading.values), name, number, progress or _silent, others=others)
        scores = document(file, name, number, leading.stage, score(file, trace)) | leading.document()
    reference = np.asarray(file.reference.position(trace.time_s), dtype=float)
    columns = {"t_s": trace.time_s, "command": trace.command, "estimate_m": trace.position_m, "reference_m": reference}
    return Run(scores, columns)


def effects() -> list[dict[str, Any]]:
    """The catalogue, with the effects from outside that are in use, as `capsule effects --json` lists it."""
    return [described(effect) for effect in _in_use.candidates]


def use_effects(*paths: str | Path) -> list[str]:
    """Let the effects of Python files take part from here on, in place of those of an earlier call; their ids."""
    global _in_use
    _in_use = Catalogue.read([Path(path) for path in paths])
    return [origin.effect.id for origin in _in_use.own]


def _silent(sentence: str, share: float) -> None:
    pass
