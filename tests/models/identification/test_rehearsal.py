"""What fits leave of records that the model made itself, beside what a right and a wrong model leave of others."""

import tomllib

import numpy as np
import pytest

from models.identification.finding import Check
from models.identification.fitting.fitter import Fitter
from models.identification.kinds.series.series import SeriesKind
from models.identification.rehearsal import left_by, rehearsed
from models.identification.settings import SET
from models.identification.verdict import within
from models.records.record import Record, read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.plant.series import make_series

Lagging = tuple[SeriesKind, Theta, list[Record], list[Record]]


@pytest.fixture(scope="module")
def lagging(tmp_path_factory: pytest.TempPathFactory) -> Lagging:
    """Kind, base and records (20 s each, one held out) of a model whose magnet follows its command by 90 ms."""
    folder = tmp_path_factory.mktemp("lag")
    make_series("magnetic", None, 4, folder, 20.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    driven = [read_record(folder / f"{name}.csv.gz", rig) for name in ("train_1", "train_2", "holdout")]
    kind, rng = SeriesKind.from_rig(rig, driven), np.random.default_rng(1)
    base = kind.nominal() | Theta({name: value for name, value in answer.items() if isinstance(value, float)})
    records = [kind.imitate(r, base.with_("actuator_lag", {"time_s": 0.09}), rng) for r in driven]
    return kind, base, records[:2], records[2:]


def judged(lagging: Lagging, effect: str) -> dict[str, Check]:
    """The checks of the records' fit with `effect`, beside all rehearsals."""
    kind, base, records, held = lagging
    theta = Fitter.of(kind, records, [effect]).near(base.with_(effect, {"time_s": 0.085})).theta
    *_, (null,) = rehearsed(kind, records, held, theta, [effect], np.random.default_rng(0))
    (left,) = left_by(kind, records, held, theta, 1.0, kind.final)
    return {check.id: check for check in within(left, null)}


def test_a_right_model_passes(lagging: Lagging) -> None:
    checks = judged(lagging, "actuator_lag")
    assert all(check.ok for check in checks.values())
    assert checks["residual_size"].value == pytest.approx(1.0, abs=0.05)


def test_a_slow_sensor_in_place_of_a_lag_fails_by_far(lagging: Lagging) -> None:
    """Compared with records of models around it, not fitted, its correlation would have been chance: the Ljung-Box
    statistic is 8,300 of 12,300.
    """
    checks = judged(lagging, "sensor_lowpass")
    for name in ("residual_size", "whiteness"):
        assert checks[name].value > 2 * checks[name].limit
    assert not checks["held_out"].ok


def test_the_limits_grow_with_every_rehearsal(lagging: Lagging) -> None:
    kind, base, records, held = lagging
    theta = base.with_("actuator_lag", {"time_s": 0.09})
    rows = [row for (row,) in rehearsed(kind, records, held, theta, ["actuator_lag"], np.random.default_rng(2))]
    assert len(rows) == SET.rehearsals
    for name in ("residual_size", "whiteness", "validation", "held_out"):
        values = [getattr(row, name) for row in rows]
        assert values == sorted(values)
        assert values[0] > 0
