"""What records must hold before anything is fitted: motion, training and validation parts, a bounded length."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from models.checks.settings import SET as CHECKS
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record, named
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)


def check_demand(record: Record) -> None:
    """Refuse a record whose prediction would take too long, or whose clock is too fine to be one."""
    if KINDS[record.kind].runs:
        runs = np.unique(np.column_stack([record[name] for name in ("period_s", "cycles")]), axis=0)
        what, span = "period_s times cycles, summed over the runs,", float(np.sum(np.prod(runs, axis=1)))
    elif record.layout.time:
        steps = np.diff(record[TIME])
        if np.median(steps) < CHECKS.step_s[0]:
            raise ValueError(TEXT("refuse.fine", name=record.name, least=CHECKS.step_s[0], step=np.median(steps)))
        what, span = "t_s", float(np.sum(steps))
    else:
        return
    most = KINDS[record.kind].longest_s
    if span > most:
        raise ValueError(TEXT("refuse.long", name=record.name, what=what, most=most, kind=record.kind, span=span))


def check_records(train: Sequence[Record], holdout: Sequence[Record]) -> None:
    """Refuse records that are constant, have a long gap or take too long to compute. Raises ValueError."""
    for record in (*train, *holdout):
        if record.layout.time:
            _check_clock(record)
        check_demand(record)
    layout = train[0].layout
    pushes = (r[name] for r in train for name in layout.driven[0] if name in r.columns)
    swings = KINDS[train[0].kind].stage and not any(push.any() for push in pushes)
    _check_change(train, (*(() if swings else layout.driven), layout.measured))
    if holdout:
        _check_change(holdout, (layout.measured,))


def check_parts(kind: Kind, train: Sequence[Record], holdout: Sequence[Record]) -> None:
    """Refuse records without a training and a validation part, or with too few numbers. Raises ValueError."""
    wanted = KINDS[kind.name].wanted
    names, nominal = ", ".join(r.name for r in train), kind.nominal()
    for record in (*train, *holdout):
        with named(record):
            kind.residual(record, nominal)
    splits = kind.splits(train)
    if not splits or not all(part and held for part, held in splits):
        raise ValueError(TEXT("refuse.parts", names=names, wanted=wanted))
    fitted = sum(p.fit for p in kind.base)
    for part, _ in splits:
        count = sum(len(kind.residual(record, nominal)) for record in part)
        if count <= fitted:
            raise ValueError(TEXT("refuse.few", names=names, fitted=fitted, count=count, wanted=wanted))


def _check_clock(record: Record) -> None:
    t = record[TIME]
    steps = np.diff(t)
    usual = float(np.median(steps))
    if usual > CHECKS.step_s[1]:
        raise ValueError(TEXT("refuse.coarse", name=record.name, most=CHECKS.step_s[1], step=usual))
    worst = int(np.argmax(steps))
    pieces = np.diff(np.flatnonzero(steps > SET.gap * usual), prepend=-1, append=len(t) - 1)
    whole = not KINDS[record.kind].stage and np.max(pieces) >= SET.whole * len(t)
    if steps[worst] > SET.gap * usual and not whole:
        raise ValueError(TEXT("refuse.gap", name=record.name, start=t[worst], end=t[worst + 1], step=usual))


def _check_change(records: Sequence[Record], groups: Sequence[Sequence[str]]) -> None:
    """One of the columns of each group must change within or between records; of a table of runs, not all be 0."""
    names, layout = ", ".join(r.name for r in records), records[0].layout
    for group in groups:
        there = [name for name in group if all(name in r.columns for r in records)]
        values = {name: np.concatenate([r[name] for r in records]) for name in there}
        constant = all(np.all(column == column[0]) for column in values.values())
        if layout.time and there and constant:
            got = values[there[0]][0]
            raise ValueError(TEXT("refuse.constant", names=names, columns=" and ".join(there), got=got))
        if not layout.time and set(group) == set(layout.measured):
            still = next((name for name, column in values.items() if not column.any()), None)
            if still is not None:
                raise ValueError(TEXT("refuse.still", names=names, column=still))
            if KINDS[records[0].kind].scatters and constant:
                raise ValueError(TEXT("refuse.same", names=names, rows=len(values[there[0]])))
