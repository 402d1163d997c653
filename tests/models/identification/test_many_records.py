"""A search of many records: how many it fits, and that it misses nothing in those that it leaves out."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from models.identification import identify, thinning
from models.identification.finding import Finding
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.settings import SET
from models.identification.thinning import thinned
from models.records.record import Record
from models.rigs.reader import parse_rig

RIG = parse_rig({"rig": {"kind": "axis"}, "noise": {"force_std_N": 0.02}})


def moved(name: str, seconds: float = 4.0, rate_Hz: float = 200.0, coulomb: float = 0.5, sag: float = 0.0) -> Record:
    """A stage of 2 kg with dry friction `coulomb`, of which a share `sag` is lost as speed grows."""
    rng = np.random.default_rng(int(name))
    t = np.arange(0.0, seconds, 1 / rate_Hz)
    angle = np.outer(t, rng.uniform(2.0, 6.0, 3)) + rng.uniform(0.0, 6.0, 3)
    w = np.gradient(angle, t, axis=0)
    x, v, a = (0.02 * (f * w**k).sum(1) for k, f in enumerate((np.sin(angle), np.cos(angle), -np.sin(angle))))
    friction = coulomb * (1 - sag * (1 - np.exp(-np.abs(v) / 0.05))) * np.sign(v) + 1.5 * v
    force = 2.0 * a + friction + 0.02 * rng.standard_normal(t.size)
    return Record(name, "axis", {"t_s": t, "position_m": x, "force_N": force})


def closed(records: Sequence[Record], monkeypatch: pytest.MonkeyPatch, most: int = 3) -> tuple[Finding, list[int]]:
    """What is found in the `records` where a search takes `most`, and how many each search took."""
    searched = list[int]()

    def counted(kind: Any, train: Sequence[Record], *rest: Any) -> Any:
        searched.append(len(train))
        return search(kind, train, *rest)

    search = identify.search
    monkeypatch.setattr(thinning, "SET", SET._replace(most_records=most))
    monkeypatch.setattr(identify, "search", counted)
    finding, _ = identify.close(RIG, records, [], lambda *_: None, drawn=False)
    return finding, searched


def test_two_hundred_long_records_are_fitted_as_two_dozen() -> None:
    records = [moved(str(k), 40.0, 250.0) for k in range(200)]
    few, others = thinned(records)
    kind = kind_for(RIG, few)
    fitted = [Fitter.of(kind, part, []) for part, _ in kind.splits(few)]
    assert (len(few), len(others)) == (24, 176)
    assert len(fitted) <= 4
    assert all(sum(map(len, one.records)) <= 1.5 * SET.most_rows for one in fitted)


def test_groups_of_records_validate_the_others_each_once() -> None:
    records = [moved(str(k), 10.0) for k in range(30)]
    splits = kind_for(RIG, records).splits(records)
    assert len(splits) == 4
    held = [record.name for _, out in splits for record in out]
    assert sorted(held) == sorted(record.name for record in records)
    assert all(len(part) + len(out) == 30 for part, out in splits)


def test_alike_records_beyond_the_most_confirm_what_the_search_found(monkeypatch: pytest.MonkeyPatch) -> None:
    finding, searched = closed([moved(str(k)) for k in range(5)], monkeypatch)
    assert searched == [3]
    assert finding.verdict == "none"
    assert next(check for check in finding.checks if check.id == "outside").ok
    assert "3 of 5 records" in finding.statements[0]


def test_an_effect_in_a_record_that_was_left_out_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its force is smaller, so that by its ranges it shows least."""
    records = [*(moved(str(k), 6.0) for k in range(5)), moved("5", sag=0.6)]
    finding, searched = closed(records, monkeypatch)
    assert searched == [3, 4]
    assert "repeated with 5" in finding.statements[0]
    assert finding.verdict == "unknown" or finding.effects
