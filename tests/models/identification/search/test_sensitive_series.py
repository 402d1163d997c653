"""What a right model leaves of itself: about the noise where teeth stay in step, much more where one early tooth moves
all that follow.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from models.identification.fitting.horizon import predictable
from models.identification.kinds.series.series import SeriesKind
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
    _, cost = predictable(kind, kind.splits(records)[0][1], theta, np.inf, np.random.default_rng(0))
    assert least < cost < most


def test_calm_motion_is_predicted_to_its_end_and_sensitive_motion_is_not(tmp_path: Path) -> None:
    kind, records, theta = _made(*CALM, tmp_path / "calm")
    assert predictable(kind, records[1:], theta, 1.5, np.random.default_rng(0))[0] == np.inf
    kind, records, theta = _made(*FALLING, tmp_path / "falling")
    assert 5.0 <= predictable(kind, records[1:], theta, 1.5, np.random.default_rng(0))[0] < 45.0
