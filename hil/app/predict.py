"""`capsule predict`: the measured column as a model that close-loop wrote predicts it from the driven column alone."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from hil.app.close_loop import TEXT, noted_record
from hil.app.console import answer, note, output_to_notes
from hil.app.scenario.model_use import note_beyond
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, OwnEffects, RigFile, Stage, argument, option
from hil.app.write import check_file, check_targets, write_table
from models.effects import Catalogue
from models.files.toml import check_word, in_file
from models.files.units import unit_at_end
from models.identification.finding import STAGES
from models.identification.model import read_model
from models.records.record import Record
from models.words.sentences import Quantity


def predict(
    record: Annotated[Path, argument("RECORD", reads="record")],
    rig: RigFile,
    model: Annotated[Path, option("--model", "MODEL.toml", reads="model")],
    out: Annotated[Path, option("--out", "PRED.csv")],
    *,
    stage: Stage = "augmented",
    json_output: Json = False,
    effects: OwnEffects,
) -> None:
    """Write the free-running prediction, one row a sample (a condition, for a table of runs)."""
    check_word(stage, "--stage", STAGES)
    check_file(out, "--out", (".csv", ".csv.gz"))
    check_targets([out], "--out", [record, rig, model])
    known = Catalogue.read(effects)
    belief = known.given_to(read_deployed_rig(rig))
    learned = read_model(model, belief.kind, whole=False, catalogue=known)
    driven = noted_record(record, belief, driven_only=True)
    with in_file(model):
        learned.check(belief, driven)
        learned.check_whole()
    if stage in learned.cautions:
        note(f"{model}: {learned.cautions[stage]}")
    with output_to_notes():
        columns = learned.predict(belief, driven, stage)
        beyond = learned.beyond(belief, driven, columns)
    note_beyond(beyond)
    write_table(out, columns)
    differences, measured = compare(driven, columns), learned.errors(belief, driven, stage)
    rows = len(next(iter(columns.values())))
    document: dict[str, Any] = {"record": str(record), "stage": stage, "prediction": str(out), "columns": list(columns)}
    errors = {name: Quantity(value, unit_at_end(name)[1]) for name, value in differences.items()}
    lines = [TEXT("predict.rms", column=name, rms=error) for name, error in errors.items()]
    for name, (value, unit, measure) in measured.items():
        lines.append(TEXT("predict.error", column=name, error=Quantity(value, unit), measure=measure))
    document["error"] = {name: dict(zip(("value", "unit", "measure"), e, strict=True)) for name, e in measured.items()}
    done = TEXT("predict.done", stage=stage, rows=rows, out=out)
    answer(json_output, {**document, "rows": rows, "rms": differences, "beyond_records": beyond}, done, *lines)


def compare(record: Record, columns: dict[str, NDArray[np.float64]]) -> dict[str, Any]:
    return {
        name: float(np.sqrt(np.mean((record[name] - columns[name]) ** 2)))
        for name in record.layout.measured
        if name in record.columns and name in columns and len(record) == len(columns[name])
    }
