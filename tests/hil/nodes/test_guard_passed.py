"""What the guard lets pass: nothing unsafe, whatever is asked for, and what is fine unchanged."""

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.drives import envelope_of
from controller.limits import Limits
from hil.nodes.frame_map import (
    BOOT,
    CARRIAGE_MAP,
    COIL_MAP,
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    INNER_MASS_MAP,
    OFF,
    QUICK_STOP,
    READY,
    SELF_TEST,
    STANDBY,
    STOPPING,
    WAITING,
)
from hil.nodes.guard import Evidence, Fence, Passed, passed
from models.drives.coil import Coil
from models.drives.magnetic import Magnetic
from models.drives.vibro import Vibro
from tests.hil.fences import CARRIAGE, COIL, GOOD
from tests.hil.ticks import TICK

ANY = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.none(),
    st.text(max_size=3),
    st.integers(),
    st.complex_numbers(),
    st.booleans(),
)


def on(value: float = 0.0) -> Passed:
    """What was let out before: enabled at `value`."""
    return Passed(value, 0.0, ENABLE)


def about(value: float) -> Any:
    """Equal to what is `value` but for rounding."""
    return pytest.approx(value)


def test_a_fine_command_leaves_unchanged() -> None:
    assert passed(0.1004, ENABLE, GOOD, on(0.1), TICK, CARRIAGE) == Passed(0.1004, about(0.2), ENABLE)
    assert passed(-0.1, ENABLE, GOOD, on(0.0), TICK, COIL) == Passed(-0.1, about(-50.0), ENABLE)


@pytest.mark.parametrize(("wanted", "left"), [(5.0, 0.8), (-5.0, -0.8), (0.8, 0.8), (-0.8, -0.8)])
def test_range(wanted: float, left: float) -> None:
    out = passed(wanted, ENABLE, GOOD, on(), 2 * TICK, replace(COIL, rate=math.inf))
    assert (out.value, out.reason) == (left, "limit" if left != wanted else "")


def test_what_is_no_more_than_a_rounding_counts_as_fine() -> None:
    """1e-9 of the range, whatever the range."""
    wide = replace(COIL, low=-1000.0, high=1000.0, rate=math.inf)
    assert passed(1000.0 + 1e-6, ENABLE, GOOD, on(), TICK, wide).reason == ""
    assert passed(1000.0 + 3e-6, ENABLE, GOOD, on(), TICK, wide).reason == "limit"


def test_travel() -> None:
    assert passed(5.0, ENABLE, GOOD, on(0.9999), TICK, CARRIAGE).value == 1.0
    assert passed(-5.0, ENABLE, GOOD, on(-0.9999), TICK, CARRIAGE).value == -1.0


def test_slew_holds_both_ways_and_from_the_first_command() -> None:
    assert passed(1.0, ENABLE, GOOD, on(0.1), TICK, CARRIAGE) == Passed(about(0.1005), about(0.25), ENABLE, 0, "limit")
    assert passed(-1.0, ENABLE, GOOD, on(0.1), TICK, CARRIAGE).value == pytest.approx(0.0995)
    assert passed(1.0, ENABLE, GOOD, Passed(0.1, 0.0, READY), TICK, CARRIAGE).value == pytest.approx(0.1005)


def test_slew_of_a_current() -> None:
    assert passed(0.8, ENABLE, GOOD, on(), TICK, COIL).value == pytest.approx(0.2)
    assert passed(0.8, ENABLE, replace(GOOD, localisation_s=0.1), on(), TICK, COIL).value == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("dt", "step"), [(10.0, 2 * TICK), (math.inf, 2 * TICK), (0.0, 0.0), (-1.0, 0.0), (math.nan, 0.0)]
)
def test_a_strange_clock_makes_no_room(dt: float, step: float) -> None:
    out = passed(1.0, ENABLE, GOOD, on(), dt, CARRIAGE)
    assert out.value == pytest.approx(0.25 * step)
    assert out.rate == (pytest.approx(0.25) if step else 0.0)


@pytest.mark.parametrize("mode", [OFF, READY])
def test_other_modes_move_nothing(mode: int) -> None:
    """Before it is enabled the carriage's command is where it is; a current is none."""
    assert passed(0.3, mode, GOOD, on(0.1), TICK, CARRIAGE) == Passed(0.3, 0.0, mode)
    assert passed(3.0, mode, GOOD, on(0.1), TICK, CARRIAGE).value == 1.0
    assert passed(math.nan, mode, GOOD, on(0.1), TICK, CARRIAGE).value == 0.1
    assert passed(0.3, mode, GOOD, on(0.1), TICK, COIL) == Passed(0.0, 0.0, mode)


def test_a_missing_command_is_held_then_fades_then_stops() -> None:
    first = passed(math.nan, ENABLE, GOOD, on(0.4), TICK, COIL)
    second = passed("none", ENABLE, GOOD, first, TICK, COIL)
    third = passed(None, ENABLE, GOOD, second, TICK, COIL)
    assert (first.value, first.missed, first.reason, first.mode) == (0.4, 1, "late", ENABLE)
    assert (second.value, second.missed, second.reason) == (about(0.2), 2, "late")
    assert (third.value, third.mode, third.reason) == (0.0, QUICK_STOP, "controller late")
    again = passed(0.4, ENABLE, GOOD, second, TICK, COIL)
    assert (again.missed, again.mode) == (0, ENABLE)


def test_a_carriage_without_commands_stays() -> None:
    first = passed(math.inf, ENABLE, GOOD, on(0.4), TICK, CARRIAGE)
    second = passed(math.nan, ENABLE, GOOD, first, TICK, CARRIAGE)
    assert (first.value, second.value, second.rate) == (0.4, 0.4, 0.0)
    assert passed(math.nan, ENABLE, GOOD, second, TICK, CARRIAGE) == Passed(0.4, 0.0, QUICK_STOP, 3, "controller late")


@pytest.mark.parametrize(
    ("evidence", "reason"),
    [
        (replace(GOOD, feedback_s=0.010), ""),
        (replace(GOOD, feedback_s=0.0101), "feedback lost"),
        (replace(GOOD, feedback_s=math.nan), "feedback lost"),
        (replace(GOOD, feedback_s=-TICK), ""),
        (replace(GOOD, feedback_s=-1.01 * TICK), "controller late"),
        (replace(GOOD, localisation_s=0.15), ""),
        (replace(GOOD, localisation_s=0.1501), "localisation lost"),
        (replace(GOOD, localisation_s=math.inf), "localisation lost"),
        (replace(GOOD, localisation_s=-1.01 * TICK), "controller late"),
        (replace(GOOD, localisation_s=-TICK), ""),
        *((replace(GOOD, state=s), "drive not enabled") for s in (BOOT, SELF_TEST, STANDBY, STOPPING, FAULT)),
        *((replace(GOOD, state=s), "") for s in (WAITING, ENABLED, DERATED)),
    ],
)
def test_evidence(evidence: Evidence, reason: str) -> None:
    for fence, rest in ((replace(CARRIAGE, feedback_s=0.01), 0.1), (COIL, 0.0)):
        out = passed(0.1, ENABLE, evidence, on(0.1), TICK, fence)
        assert out == (Passed(rest, 0.0, QUICK_STOP, 0, reason) if reason else Passed(0.1, 0.0, ENABLE))


@pytest.mark.parametrize("way", [1, -1])
def test_a_fast_carriage_is_waited_for_by_as_much_less_as_it_takes_to_brake(way: int) -> None:
    """From 0.1 m/s at 25 m/s2: 4 ms of the 20."""
    before = replace(on(0.1), rate=0.1 * way)
    assert passed(0.1, ENABLE, replace(GOOD, feedback_s=0.016 - 1e-6), before, TICK, CARRIAGE).reason == ""
    assert passed(0.1, ENABLE, replace(GOOD, feedback_s=0.016 + 1e-6), before, TICK, CARRIAGE).reason == "feedback lost"
    assert passed(0.1, ENABLE, replace(GOOD, feedback_s=0.010), before, TICK, COIL).reason == ""


def test_old_localisation_halves_what_is_allowed() -> None:
    old = replace(GOOD, localisation_s=0.0501)
    assert passed(1.0, ENABLE, old, on(0.1), TICK, CARRIAGE).value == pytest.approx(0.1 + 0.5 * 0.25 * TICK)
    assert passed(0.8, ENABLE, old, on(0.4), TICK, COIL).value == 0.4
    assert passed(-0.8, ENABLE, old, on(-0.4), TICK, COIL).value == -0.4
    assert passed(0.9, ENABLE, old, on(0.9), TICK, CARRIAGE) == Passed(0.9, 0.0, ENABLE), (
        "a carriage is slowed, not drawn back"
    )
    just = replace(GOOD, localisation_s=0.05)
    assert passed(1.0, ENABLE, just, on(0.1), TICK, CARRIAGE).value == pytest.approx(0.1005)


def test_a_stop_holds_until_another_mode_is_asked_for() -> None:
    stopped = Passed(0.1, 0.0, QUICK_STOP, 0, "feedback lost")
    assert passed(0.2, ENABLE, GOOD, stopped, TICK, CARRIAGE) == stopped
    off = passed(0.1, OFF, GOOD, stopped, TICK, CARRIAGE)
    assert (off.mode, off.reason) == (OFF, "")
    assert passed(0.1, ENABLE, GOOD, off, TICK, CARRIAGE).mode == ENABLE


@given(
    wanted=st.lists(
        st.tuples(ANY, st.sampled_from([OFF, READY, ENABLE]), st.floats(), st.floats(), st.floats(), st.integers(0, 9))
    ),
    fence=st.sampled_from([CARRIAGE, COIL]),
)
def test_whatever_is_asked_for(wanted: list[tuple[object, int, float, float, float, int]], fence: Fence) -> None:
    """Finite, within range and slew while enabled, and enabled on good evidence alone."""
    before = Passed(0.0, 0.0, OFF)
    for value, mode, dt, place, feed, state in wanted:
        out = passed(value, mode, Evidence(place, feed, state), before, dt, fence)
        assert fence.low <= out.value <= fence.high
        assert math.isfinite(out.rate)
        if out.mode == ENABLE:
            assert abs(out.value - before.value) <= fence.rate * 2 * TICK * (1 + 1e-9)
            assert place <= fence.stop_s
            assert feed <= fence.feedback_s
            assert state in (WAITING, ENABLED, DERATED)
            assert before.mode != QUICK_STOP
        before = out


def test_fence_of_limits() -> None:
    limits = Limits(current_A=0.7, age_s=0.12)
    carriage = Fence.of(envelope_of(Magnetic(25.0, 0.02), limits), CARRIAGE_MAP, TICK)
    assert (carriage.low, carriage.high, carriage.rate, carriage.rests) == (-1.0, 1.0, 0.25, True)
    assert (carriage.tick_s, carriage.stop_s, carriage.derate_s, carriage.late_stop) == (TICK, 0.12, 0.05, 3)
    assert (carriage.feedback_s, carriage.braking) == (0.0215, 25.0)
    coil = Fence.of(envelope_of(Coil(0.5), limits), COIL_MAP, TICK)
    assert (coil.low, coil.high, coil.rate, coil.rests) == (-0.7, 0.7, 1200.0, False)
    assert (coil.feedback_s, coil.braking) == (0.0045, math.inf)
    inner_mass = Fence.of(envelope_of(Vibro(), limits), INNER_MASS_MAP, TICK)
    assert (inner_mass.low, inner_mass.high, inner_mass.rests) == (0.0, 1.0, False)
    assert (inner_mass.feedback_s, inner_mass.braking) == (0.0065, math.inf)
