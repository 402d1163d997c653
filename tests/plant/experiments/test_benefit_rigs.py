"""The rigs of the bench of benefit: the same by number, in the shares that are told, and runnable."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from hil.app.scenario.scenario import parse_track_scenario
from models.files.toml import toml_text
from models.records.record import read_record
from models.rigs.reader import read_rig
from tests.bench.bench_benefit import CHOSEN, COLUMNS, RIGHT, Row, error_mm, figures
from tests.bench.benefit_rigs import OTHERS, RECORDS, RIG, drawn

COUNT = 40


def test_a_rig_is_the_same_by_its_number_and_the_forty_have_the_shares_that_are_told() -> None:
    rigs = [drawn(number) for number in range(COUNT)]
    assert drawn(7) == rigs[7] != drawn(8)
    assert [rig.other for rig in rigs if rig.other] == list(OTHERS)
    assert 8 <= sum(not rig.recorded for rig in rigs) <= 10
    kinds = [rig.kind for rig in rigs]
    assert kinds.count("magnetic") > kinds.count("coil") > kinds.count("vibro") >= 6
    assert all(0.85 <= share <= 1.15 for rig in rigs for share in rig.shares.values())


@pytest.mark.parametrize("number", [2, 5, 3])
def test_a_lab_moves_each_kind_and_the_references_are_within_its_limits(number: int, tmp_path: Path) -> None:
    rig = drawn(number)
    rig.write_records(tmp_path)
    belief = read_rig(tmp_path / RIG)
    for name, (_, seconds) in zip(RECORDS, rig.motions, strict=True):
        record = read_record(tmp_path / name, belief)
        assert 8.0 <= seconds <= 40.0
        assert np.ptp(record.columns["position_m"]) > 4e-3
    for reference in range(len(rig.references)):
        scenario = parse_track_scenario(tomllib.loads(toml_text(rig.scenario(reference))))
        assert scenario.truth.hoop_factor == pytest.approx(rig.shares["hoop_stress_factor"])
        assert scenario.belief.kind == rig.kind
        assert scenario.kind == rig.kind


def runs(errors_mm: dict[str, float], verdict: str, broken: int = 0) -> list[Row]:
    rows: list[Row] = [{"what": "close-loop", "controller": "", "reference": 0, "verdict": verdict}]
    return rows + [
        {"what": what, "controller": "", "reference": k, "rmse_m": 1e-3 * mm, "hard_violations": broken}
        for what, mm in errors_mm.items()
        for k in (0, 1)
    ]


def test_the_figures_count_what_loses_halves_and_is_named_falsely() -> None:
    hidden, clean = drawn(0), drawn(2)
    gains = dict.fromkeys(COLUMNS, 0.4) | {CHOSEN: 0.1, RIGHT: 0.1}
    loses = dict.fromkeys(COLUMNS, 0.1) | {CHOSEN: 0.2}
    told = figures([(hidden, runs(gains, "named")), (clean, runs(loses, "unknown", broken=3))])
    assert "4.00; right: 4.00" in told[1]
    assert told[2].endswith(": 1 of 1")
    assert ": 1 of 2;" in told[0]
    assert "1 rigs, 6 ticks; 1 rigs, 36 ticks" in told[3]
    assert told[4].endswith(": 1 of 1")
    assert math.isnan(error_mm(runs(gains, "named")[:3], CHOSEN))
