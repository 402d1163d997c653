"""Records in; what the model lacks, and the better model, out."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.identification.answer import answer
from models.identification.finding import Finding
from models.identification.judgement import Judged, Predicted
from models.identification.kinds import NOTHING_KNOWN, Known
from models.identification.model import Model, own_effects_of
from models.identification.preparation import Prepared
from models.identification.search.forward_selection import search
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.rig import Rig


def close(
    rig: Rig,
    train: Sequence[Record],
    holdout: Sequence[Record],
    progress: Callable[[str, float], None],
    seed: int = 0,
    known: Known = NOTHING_KNOWN,
    most: int = SET.most_effects,
) -> tuple[Finding, Model]:
    """Calibrate the rig's model on `train`, find what it lacks, and report the errors before and after; `holdout` is
    only checked for what makes it unusable until the end.

    Base parameters that are `known` from elsewhere replace the rig file's and constrain the calibration as its
    `[prior]` does; known effects belong to the base. At `most` so many effects are searched for. The same records and
    `seed` give the same numbers. Raises ValueError for records from which nothing is identifiable.
    """
    began = time.monotonic()
    prepared = Prepared.of(rig, train, holdout, known)
    found = search(prepared.kind, prepared.train, progress, np.random.default_rng(seed), most)
    progress("held-out records", 0.95)
    predicted = Predicted.of(prepared.kind, found, {"train": prepared.train, "holdout": prepared.holdout})
    judged = Judged.of(prepared, found, predicted.error["holdout"], seed)
    progress("the next experiment", 0.97)
    finding = answer(prepared, found, predicted, judged, seed)
    model = _model(prepared, predicted, judged, seed)
    progress("done", 1.0)
    return replace(finding, seconds=time.monotonic() - began), model


def _model(prepared: Prepared, predicted: Predicted, judged: Judged, seed: int) -> Model:
    held_out: Mapping[str, float] = {s: float(e) for s, e in predicted.error["holdout"].items() if np.isfinite(e)}
    return Model(
        prepared.kind.name,
        predicted.thetas,
        judged.verdict,
        {"records": ", ".join(record.name for record in prepared.train), "seed": str(seed)},
        held_out,
        own_effects_of(predicted.thetas, prepared.kind.catalogue),
        judged.worse,
    )
