"""From score to probability: what is said is what was right, and never more than the series allow."""

from pathlib import Path

import numpy as np
import pytest

from models.identification.confidence_map import ConfidenceMap, confidence_map, read_map
from models.identification.settings import SET
from tests.bench.bench_calibration import (
    Statement,
    cross_validated,
    expected_calibration_error,
    isotonic,
    keep_rows,
    kept_rows,
    map_toml,
)


def said(count: int, seed: int = 0) -> list[Statement]:
    """Statements that are right with the square of their score."""
    rng = np.random.default_rng(seed)
    scores = rng.uniform(0.5, 1.0, count)
    return [Statement(float(p), bool(rng.random() < p * p)) for p in scores]


def test_without_enough_series_nothing_is_called_calibrated() -> None:
    few = ConfidenceMap(SET.calibrated_on - 1, 40, "2026-01-01", (0.5, 1.0), (0.4, 0.9))
    assert not few.calibrated
    assert "not calibrated" in few.words(few.probability(0.9))
    none = ConfidenceMap(0, 0, "", (), ())
    assert none.probability(0.999) == 0.999


def test_the_map_in_use_is_one() -> None:
    known = confidence_map()
    assert known.calibrated == (known.series >= SET.calibrated_on)
    assert known.most < 1
    assert list(known.score) == sorted(known.score)
    assert list(known.right) == sorted(known.right)
    assert len(known.score) == len(known.right)
    assert all(0 <= share <= 1 for share in known.right)
    assert 0 <= known.probability(1.0) <= (known.most if known.calibrated else 1.0)


def test_a_fitted_map_says_what_came_true_and_no_more() -> None:
    rows = said(400)
    made = isotonic(rows, 300, "2026-01-01")
    assert made.calibrated
    assert 2 <= len(made.score) <= 41
    assert made.probability(0.9) == pytest.approx(0.81, abs=0.1)
    assert made.words(0.87).startswith("Confidence 87 %: of simulated series with this score, 87 in 100")
    assert expected_calibration_error(cross_validated(rows, 300)) < 0.08
    sure = isotonic([Statement(0.9 + 1e-4 * i, True) for i in range(50)], 100, "")
    assert sure.probability(1.0) <= 51 / 52


def test_a_map_survives_its_file(tmp_path: Path) -> None:
    made = isotonic(said(200), 150, "2026-01-01")
    path = tmp_path / "map.toml"
    path.write_text(map_toml(made))
    again = read_map(path)
    assert (again.series, again.statements, again.date) == (150, 200, "2026-01-01")
    np.testing.assert_allclose(again.right, made.right, rtol=1e-3)


def test_a_line_a_series_is_kept_once_and_belongs_to_its_draw(tmp_path: Path) -> None:
    effect = {"id": "stenosis", "equivalent": [], "confidence_score": 0.9}
    result = {"verdict": "named", "effects": [{**effect, "parameters": {}}], "seconds": 12.0, "error": {}}
    rows = tmp_path / "rows.jsonl"
    keep_rows(rows, 2, 12.0, {"0001_pull_clean": result})
    keep_rows(rows, 2, 12.0, {"0001_pull_clean": result, "0000_pull_poor": {**result, "verdict": "unknown"}})
    keep_rows(rows, 3, 12.0, {"0001_pull_clean": result})
    kept = kept_rows(rows, 2, 12.0)
    assert {name: row["verdict"] for name, row in kept.items()} == {
        "0001_pull_clean": "named",
        "0000_pull_poor": "unknown",
    }
    assert kept["0001_pull_clean"]["effects"] == [effect]
    assert kept_rows(rows, 2, 45.0) == kept_rows(None, 2, 12.0) == {}
    assert len(rows.read_text(encoding="utf-8").splitlines()) == 3


def test_equal_scores_have_one_knot() -> None:
    """What was said first counts no more than what was said last."""
    half = [Statement(0.5, k >= 10) for k in range(30)]
    made = isotonic([*half, *(Statement(1.0, True) for _ in range(20))], 100, "")
    assert made.score == (0.5, 1.0)
    assert made.right == pytest.approx((21 / 32, 21 / 22))
