"""Every effect that declares a kind of rig is a candidate there, and shows in its predictions."""

import numpy as np
import pytest

from hil.app.init import template
from models.effects import EFFECTS
from models.identification.kinds import kind_for
from models.identification.kinds.reports import AnyKind
from models.records.record import Record
from models.rigs.kind import Record as Columns
from models.rigs.kinds import KINDS
from models.rigs.reader import parse_rig
from models.theta import Theta

SERIES = ("pull", "magnetic", "coil", "vibro")
"""Kinds whose predictions `tests/models/effects/test_effects.py` looks at, effect by effect."""


TURNING, TWO_SPEEDS = "axis that turns", "periods at two speeds"


@pytest.fixture(scope="module", params=(*(k for k in KINDS if k not in ("axis", "periods")), TURNING, TWO_SPEEDS))
def made(request: pytest.FixtureRequest) -> tuple[AnyKind, Record]:
    """Each kind, driven so that every one of its effects can show."""
    tables, columns = template(KINDS[request.param.split()[0]], rotary=request.param == TURNING)
    rig = parse_rig(tables)
    if request.param == TURNING:
        columns = {**columns, "load_N_m": 2 + np.sin(np.arange(len(columns["t_s"])) / 300)}
    if request.param == TWO_SPEEDS:
        columns = two_speeds(columns)
    if request.param == "friction":
        way = np.where(np.arange(len(columns["force_N"])) % 2, -1, 1)
        columns = {**columns, **{name: way * columns[name] for name in ("velocity_m_s", "force_N")}}
    record = Record("template", rig.kind, dict(columns))
    return kind_for(rig, [record]), record


def two_speeds(columns: Columns) -> Columns:
    """The record of periods, and the same at ten times the speed."""
    both = {name: np.concatenate([values, values]) for name, values in columns.items()}
    n = len(next(iter(columns.values())))
    slow = columns.get("velocity_m_s", np.full(n, 5e-4))
    return both | {"velocity_m_s": np.concatenate([slow, 10 * slow])}


def test_an_error_in_per_cent_has_that_unit(made: tuple[AnyKind, Record]) -> None:
    kind, _ = made
    assert (kind.error_unit == "%") == ("relative" in kind.measure)


def test_every_declared_pair_is_tried(made: tuple[AnyKind, Record]) -> None:
    kind, record = made
    declared = {effect.id for effect in EFFECTS if kind.name in effect.kinds}
    tried = {effect.id: effect for effect in kind.effects}
    assert declared <= set(tried)
    assert declared
    if kind.name in SERIES:
        return
    base = kind.nominal()
    plain = np.asarray(kind.predict(record, base))
    for effect in tried.values():
        values = Theta.of({(effect.id, p.name): p.value for p in effect.parameters()})
        shown = Theta.of({**values, (effect.id, effect.amplitude().name): effect.probe})
        moved = np.abs(np.asarray(kind.predict(record, Theta.of({**base, **shown}))) - plain)
        assert np.isfinite(moved).all()
        assert moved.max() > 1e-6 * np.ptp(plain), effect.id
