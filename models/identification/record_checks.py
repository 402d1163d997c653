"""What records must hold before anything is fitted: motion, training and validation parts, a bounded length."""

from collections.abc import Sequence

import numpy as np

from models.checks.settings import SET as CHECKS
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record, named
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS


def check_demand(record: Record) -> None:
    """Refuse a record whose prediction would take too long, or whose clock is too fine to be one."""
    if KINDS[record.kind].runs:
        runs = np.unique(np.column_stack([record[name] for name in ("period_s", "cycles")]), axis=0)
        what, span = "period_s times cycles, summed over the runs,", float(np.sum(np.prod(runs, axis=1)))
    elif record.layout.time:
        steps = np.diff(record[TIME])
        if np.median(steps) < CHECKS.step_s[0]:
            raise ValueError(
                f"{record.name}: t_s must step by at least {CHECKS.step_s[0]:g} s; got steps of {np.median(steps):g} s"
            )
        what, span = "t_s", float(np.sum(steps))
    else:
        return
    most = KINDS[record.kind].longest_s
    if span > most:
        raise ValueError(f"{record.name}: {what} must span at most {most:g} s for kind {record.kind}; got {span:g} s")


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
        raise ValueError(f"{names}: records must have a training and a validation part; needed are {wanted}")
    fitted = sum(p.fit for p in kind.base)
    for part, _ in splits:
        count = sum(len(kind.residual(record, nominal)) for record in part)
        if count <= fitted:
            raise ValueError(
                f"{names}: records must hold more numbers than the {fitted} that are fitted, also with the validation"
                f" part left out; got {count}; needed are {wanted}"
            )


def _check_clock(record: Record) -> None:
    t = record[TIME]
    steps = np.diff(t)
    usual = float(np.median(steps))
    if usual > CHECKS.step_s[1]:
        raise ValueError(
            f"{record.name}: t_s must step by at most {CHECKS.step_s[1]:g} s; got steps of {usual:g} s: is it in s?"
        )
    worst = int(np.argmax(steps))
    pieces = np.diff(np.flatnonzero(steps > SET.gap * usual), prepend=-1, append=len(t) - 1)
    whole = not KINDS[record.kind].stage and np.max(pieces) >= SET.whole * len(t)
    if steps[worst] > SET.gap * usual and not whole:
        raise ValueError(
            f"{record.name}: t_s must go on without a gap; got none between {t[worst]:.12g} s and {t[worst + 1]:.12g} s"
            f" where steps are {usual:g} s: cut the record there"
        )


def _check_change(records: Sequence[Record], groups: Sequence[Sequence[str]]) -> None:
    """One of the columns of each group must change within or between records; of a table of runs, not all be 0."""
    names, layout = ", ".join(r.name for r in records), records[0].layout
    for group in groups:
        there = [name for name in group if all(name in r.columns for r in records)]
        values = {name: np.concatenate([r[name] for r in records]) for name in there}
        constant = all(np.all(column == column[0]) for column in values.values())
        if layout.time and there and constant:
            got = values[there[0]][0]
            raise ValueError(f"{names}: {' and '.join(there)} must change to identify anything; got {got:g} throughout")
        if not layout.time and set(group) == set(layout.measured):
            still = next((name for name, column in values.items() if not column.any()), None)
            if still is not None:
                raise ValueError(f"{names}: {still} must differ from 0 in some rows; got 0 throughout")
            if KINDS[records[0].kind].scatters and constant:
                rows = len(values[there[0]])
                raise ValueError(f"{names}: periods must scatter as measured ones do; got {rows} times the same row")
