"""Columns with clocks of their own on one: nothing is invented over a gap, a wrong stamp costs its own sample."""

import numpy as np
import pytest

from models.records.clock import ClockError, are_differences, in_gaps, in_order, one_clock
from models.records.record import USED, record_of
from models.rigs.rig import Rig

T = 0.005 * np.arange(3000)
X = np.sin(T)
LATE = T + 0.0013


def both(tc: np.ndarray, tx: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """A carriage at its stamps and a capsule at its own; values are those of the true times `T` or of what is there."""
    carriage = np.sin(tc) if len(tc) != len(T) else X
    place = np.cos(tx) if len(tx) != len(T) else np.cos(LATE)
    return {"position_m": (tx, place), "carriage_position_m": (tc, carriage)}


def test_a_dropout_of_the_drive_is_no_straight_line() -> None:
    kept = (T < 6) | (T > 11)
    columns, _, lost = one_clock(both(T[kept], LATE), "position_m")
    told = next(one for one in lost if one.why == "gap")
    t = columns["t_s"]
    assert not ((t > 6.01) & (t < 10.99)).any()
    assert columns["carriage_position_m"] == pytest.approx(np.sin(t), abs=1e-5)
    assert "carriage_position_m" in told.sentence
    assert told.where.startswith("5.9963 s, 6.0013 s")


def test_a_dropout_of_the_sensor_leaves_the_drive_and_no_value() -> None:
    kept = (T < 6) | (T > 11)
    columns, _, _ = one_clock(both(T, LATE[kept]), "position_m")
    t, place = columns["t_s"], columns["position_m"]
    lost = (t > 6.01) & (t < 10.99)
    assert lost.sum() == pytest.approx(5 / 0.005, abs=5)
    assert np.isnan(place[lost]).all()
    assert columns["carriage_position_m"] == pytest.approx(np.sin(t), abs=1e-5)
    record = record_of("one", columns, Rig("magnetic"))
    assert record[USED].sum() == len(T) - (~kept).sum() - 1  # the last comes after the carriage's


@pytest.mark.parametrize("who", ["position_m", "carriage_position_m"])
@pytest.mark.parametrize("away", [12.0, -3.0])
def test_a_stamp_far_off_costs_one_sample(who: str, away: float) -> None:
    stamps = {"position_m": LATE.copy(), "carriage_position_m": T.copy()}
    stamps[who][1500] += away
    columns, _, told = one_clock(both(stamps["carriage_position_m"], stamps["position_m"]), "position_m")
    assert len(columns["t_s"]) >= len(T) - 3
    assert columns["carriage_position_m"] == pytest.approx(np.sin(columns["t_s"]), abs=2e-5)
    assert [one.column for one in told if one.why == "stamps_astray"] == [who]


def test_clocks_that_begin_again_together_stay_as_they_are_and_one_alone_is_refused() -> None:
    again = [np.where(np.arange(3000) < 1500, t, t - 7.5) for t in (T, LATE)]
    columns, _, _ = one_clock(both(*again), "position_m")
    assert np.sum(np.diff(columns["t_s"]) < 0) == 1
    with pytest.raises(ClockError, match="clocks must begin again together; got that of position_m"):
        one_clock(both(T, again[1]), "position_m")


def test_clocks_without_time_in_common_are_named() -> None:
    with pytest.raises(ClockError, match=r"time in common; got position_m 1000 to .* carriage_position_m 0 to"):
        one_clock(both(T, LATE + 1000), "position_m")


def test_a_doubled_stamp_costs_its_row_and_differences_become_times() -> None:
    doubled = T.copy()
    doubled[700] = doubled[699]
    columns = {"carriage_position_m": X, "position_m": np.cos(T)}
    record = record_of("one", {"t_s": doubled, **columns}, Rig("magnetic"))
    assert (len(record), record.left_out[0].why) == (2999, "stamps_repeated")
    steps = np.diff(T, prepend=0.0)
    assert are_differences(steps)
    summed = record_of("one", {"t_s": steps, **columns}, Rig("magnetic"))
    assert summed["t_s"] == pytest.approx(T, abs=1e-9)
    assert summed.left_out[0].why == "differences"


@pytest.mark.parametrize(
    "stamps",
    [T, np.round(T, 1), T[::-1], np.random.default_rng(0).permutation(T), 1.7e9 + T, np.concatenate([T, T])],
    ids=["even", "coarse", "reversed", "shuffled", "calendar", "restarted"],
)
def test_times_are_no_differences(stamps: np.ndarray) -> None:
    assert not are_differences(stamps)
    assert not are_differences(stamps, even=False) or (np.diff(stamps) > 0).mean() < 0.6  # no log is shuffled


def test_the_fewest_samples_are_left_out() -> None:
    stamps = np.array([0.0, 1, 2, 99, 3, 4, 5, 5, 6, *range(7, 400)])
    kept, back = in_order(stamps)
    assert not back
    assert list(stamps[~kept]) == [99, 5]


def test_samples_in_bursts_are_no_gaps() -> None:
    bursts = (0.1 * np.arange(100)[:, None] + 1e-4 * np.arange(10)).ravel()
    assert not in_gaps(np.linspace(0, 9.9, 500), bursts).any()
