"""What a right model leaves of itself: about the noise where teeth stay in step, much more where one early tooth moves
all that follow.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from models.identification.kinds.series.series import SeriesKind
from models.identification.search.sensitivity import predictable, sensitivity_cost
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.plant.series import make_series

CALM = (None, {}, 15.0)
FALLING = ("stribeck", Theta.of({("stribeck", "excess"): 0.56, ("stribeck", "speed_m_s"): 0.003}), 45.0)


def _made(
    effect: str | None, values: dict[str, float], seconds: float, folder: Path
) -> tuple[SeriesKind, list, dict[str, float]]:  # type: ignore[type-arg]
    make_series("magnetic", effect, 1, folder, seconds)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2)]
    theta = Theta({name: value for name, value in answer.items() if isinstance(value, float)}) | values
    return SeriesKind.from_rig(rig, records), records, theta


@pytest.mark.parametrize(("case", "least", "most"), [(CALM, 0.9, 1.5), (FALLING, 3.0, np.inf)])
def test_a_falling_resistance_makes_a_magnet_drawn_capsule_sensitive(
    case: tuple[str | None, dict[str, float], float], least: float, most: float, tmp_path: Path
) -> None:
    kind, records, theta = _made(*case, tmp_path)
    assert least < sensitivity_cost(kind, kind.splits(records), theta, np.random.default_rng(0)) < most


def test_calm_motion_is_predicted_to_its_end_and_sensitive_motion_is_not(tmp_path: Path) -> None:
    kind, records, theta = _made(*CALM, tmp_path / "calm")
    length, splits = predictable(kind, kind.splits(records), theta, 1.5, np.random.default_rng(0))
    assert length == np.inf
    assert [len(part) for part in splits[0][0]] == [len(records[0])]
    kind, records, theta = _made(*FALLING, tmp_path / "falling")
    length, splits = predictable(kind, kind.splits(records), theta, 1.5, np.random.default_rng(0))
    assert 5.0 <= length < 45.0
    assert all(record["t_s"][-1] < length for part in splits[0] for record in part)
