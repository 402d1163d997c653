"""Proposed motions stay within what the rig is known to do."""

import numpy as np
import pytest

from models.identification.motion_plan import Move, Plan, Room
from models.identification.settings import SET
from models.records.record import Record

ROOM = Room("pull", "position_m", 0.0, 20e-3, 0.0, 8e-3, 12.0, 2e-3)


def one_pass(speed: float = 1e-3, length: float = 20.0) -> Record:
    t = np.arange(round(length / 2e-3) + 1) * 2e-3
    return Record("pass", "pull", {"t_s": t, "position_m": speed * t, "force_N": 0 * t})


def test_the_room_is_what_the_records_hold() -> None:
    room = Room.of([one_pass(length=40.0), one_pass(length=48.0)], "position_m")
    assert (room.low, room.high) == pytest.approx((0.0, 48e-3))
    assert room.length == pytest.approx(22.0)
    assert Room.of([one_pass(length=10.0)], "position_m").length == pytest.approx(20.0)
    assert room.dt == pytest.approx(2e-3)
    assert room.speed == pytest.approx(4e-3)
    assert Room.of([one_pass(20e-3)], "position_m").speed == pytest.approx(20e-3)


@pytest.mark.parametrize("seed", range(20))
def test_motions_stay_in_the_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plan = ROOM.random(rng)
    for _ in range(10):
        times, _ = plan.waypoints()
        assert np.all(np.diff(times) > 0)
        assert times[-1] == ROOM.length
        record = plan.motion
        x = record["position_m"]
        assert len(record) == 6001
        assert x[0] == ROOM.start
        assert x.min() >= ROOM.low - 1e-12
        assert x.max() <= ROOM.high + 1e-12
        assert np.max(np.abs(np.diff(x))) / ROOM.dt <= ROOM.speed * (1 + 1e-6)
        plan = plan.varied(rng)


def test_a_variation_changes_the_motion() -> None:
    rng = np.random.default_rng(0)
    plan = ROOM.random(rng)
    before = plan.motion["position_m"]
    changed = [not np.array_equal(before, plan.varied(rng).motion["position_m"]) for _ in range(20)]
    assert np.mean(changed) > 0.5


def test_waypoints_are_the_moves() -> None:
    plan = Plan(ROOM, (Move(8e-3, 4e-3, 1.0), Move(0.0, 2e-3, 0.0), Move(16e-3, 1e-3, 0.0)))
    times, places = plan.waypoints()
    assert times == pytest.approx([0.0, 0.3, 2.3, 3.3, 7.3, 12.0])
    assert places == pytest.approx([0.0, 0.0, 8e-3, 8e-3, 0.0, 4.7e-3])
    record = plan.motion
    later = np.interp(times[1:-1] + SET.ramp_s, record["t_s"], record["position_m"])
    assert later == pytest.approx(places[1:-1], abs=5e-4)


def test_a_carriage_that_trembles_is_not_fast() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    steady = 2e-3 * np.minimum(t, 20.0 - t)
    rng = np.random.default_rng(3)
    shaken = steady + 1.2e-3 * np.sin(2 * np.pi * 9.0 * t) + 3e-4 * rng.standard_normal(t.size)
    rooms = [Room.of([Record("r", "magnetic", {"t_s": t, "x": x})], "x") for x in (steady, shaken)]
    assert rooms[1].speed <= 1.3 * rooms[0].speed
    assert rooms[1].speed <= 10e-3
