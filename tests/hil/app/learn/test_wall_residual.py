"""What a model left while it held is taken off by place and way, and nothing else is."""

import numpy as np
import pytest

from hil.app.learn.identify import LearningQuestion, WallResidual, _before_the_break
from models.identification.kinds import kind_for, ready
from models.records.record import Record
from models.rigs.columns import TIME
from models.theta import Theta
from tests.controller.loops import believed

SPEED, FAR, DT = 4e-3, 16e-3, 0.01
UNEVEN_M = 0.3e-3


def to_and_fro(seconds: float) -> np.ndarray:
    t = np.arange(0.0, seconds, DT)
    return np.abs((SPEED * t + FAR) % (2 * FAR) - FAR)


def uneven(places: np.ndarray) -> np.ndarray:
    return UNEVEN_M * np.sin(2 * np.pi * places / 12e-3)


@pytest.fixture(scope="module")
def run() -> tuple[Record, np.ndarray, np.ndarray]:
    """Record of a capsule in an uneven gut, its prediction, and what that leaves."""
    rig, led = believed("magnetic"), to_and_fro(80.0)
    t = DT * np.arange(led.size)
    plain = Record("run", "magnetic", {TIME: t, "carriage_position_m": led, "position_m": led.copy()})
    kind = kind_for(rig, [plain])
    predicted = np.asarray(kind.predict(plain, kind.nominal()))
    noise = 1e-4 * np.random.default_rng(0).standard_normal(led.size)
    left = uneven(predicted)
    return plain.with_column("position_m", predicted + left + noise), predicted, left


def test_it_tells_the_unevenness_each_way(run: tuple[Record, np.ndarray, np.ndarray]) -> None:
    record, predicted, left = run
    rig = believed("magnetic")
    kind = kind_for(rig, [record])
    found = WallResidual.of(kind, ready(record, rig), kind.nominal(), "carriage_position_m")
    told = found.at(predicted, record["carriage_position_m"])
    assert np.sqrt(np.mean((told - left)[1000:] ** 2)) < 0.2 * UNEVEN_M
    assert np.all(found.at(np.array([-1.0, 1.0]), np.zeros(2)) == 0.0), "nothing is known of places never seen"


def test_what_broke_the_model_stays(run: tuple[Record, np.ndarray, np.ndarray]) -> None:
    record, _, _ = run
    rig, broken = believed("magnetic"), len(record) // 2
    shift = np.where(np.arange(len(record)) >= broken, 0.5e-3, 0.0)
    columns = {**record.columns, "position_m": record["position_m"] + shift}
    _, values, corrected = _before_the_break(
        LearningQuestion(rig, columns, 3 * broken // 2, Theta(), broken_from=broken)
    )
    kind = kind_for(rig, [record])
    left = corrected["position_m"] - kind.predict(record, kind.nominal() | values)
    assert np.median(left[broken:]) == pytest.approx(0.5e-3, abs=0.05e-3)
    assert np.std(left[broken:]) < 0.6 * UNEVEN_M


def test_too_short_a_time_before_the_break_changes_nothing(run: tuple[Record, np.ndarray, np.ndarray]) -> None:
    record, _, _ = run
    question = LearningQuestion(believed("magnetic"), record.columns, 3000, Theta(), broken_from=500)
    assert _before_the_break(question) == (believed("magnetic"), Theta(), record.columns)


def test_what_no_place_tells_counts_as_noise_and_does_not_bend_the_base(
    run: tuple[Record, np.ndarray, np.ndarray],
) -> None:
    record, _, _ = run
    rig, broken = believed("magnetic"), len(record) // 2
    slow = 0.4e-3 * np.sin(2 * np.pi * record[TIME] / 23.0)
    columns = {**record.columns, "position_m": record["position_m"] + slow}
    nominal = kind_for(rig, [record]).nominal()
    noisy, values, _ = _before_the_break(LearningQuestion(rig, columns, 3 * broken // 2, Theta(), broken_from=broken))
    assert noisy.noise.position_std_m is not None
    assert noisy.noise.position_std_m > 0.3e-3
    assert all(abs(values[name] / nominal[name] - 1) < 0.1 for name in values)
    quiet, _, _ = _before_the_break(LearningQuestion(rig, record.columns, 3 * broken // 2, Theta(), broken_from=broken))
    assert (quiet.noise.position_std_m or 0.0) < UNEVEN_M
