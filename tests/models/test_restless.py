"""What a right model leaves of itself: about the noise where teeth stay in step, much more where one early tooth moves all that follow."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from models.identification.horizon import restlessness
from models.identification.kinds.gut import GutKind
from models.record import read_record
from models.rig import read_rig
from plant.series import make_series


@pytest.mark.parametrize(
    ("effect", "values", "least", "most"),
    [
        (None, {}, 0.9, 1.5),
        ("stribeck", {"stribeck.excess": 0.56, "stribeck.speed_m_s": 0.003}, 3.0, np.inf),
    ],
)
def test_a_falling_resistance_makes_a_magnet_drawn_capsulerestlessness(
    effect: str | None, values: dict[str, float], least: float, most: float, tmp_path: Path
) -> None:
    folder = make_series("magnetic", effect, 1, tmp_path, 45.0 if effect else 15.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    train = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2)]
    kind = GutKind.from_rig(rig, train)
    theta = {name: value for name, value in answer.items() if isinstance(value, float)} | values
    cost = restlessness(kind, kind.folds(train), theta, np.random.default_rng(0))
    assert least < cost < most
