"""Limits: no input whatsoever gets a command past them, and what breaks none of them passes unchanged."""

import math
import re
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from controller.drives import envelope_of, gap_of_force
from controller.limits import Envelope, Issued, Limits, Seen, limited, number
from models.drives.coil import Coil, VoltageCoil, Winding
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import RatedVibro, Vibro

LIMITS = Limits()
DRIVES = (
    Magnetic(),
    Magnetic(400.0, 0.05),
    Coil(),
    Coil(-2.0),
    VoltageCoil(0.5, 0.0, None, Winding(20.0, 10e-3, 0.4)),
    Vibro(),
    RatedVibro(),
)
ENVELOPES = tuple(envelope_of(drive) for drive in DRIVES)
SPECIAL = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -5e-324, 1.8e308, -1.8e308, 1e300, 2.2e-308)
floats = st.one_of(st.sampled_from(SPECIAL), st.floats(), st.floats(-2, 2))
anything = st.one_of(
    floats,
    st.none(),
    st.text(max_size=3),
    st.booleans(),
    st.integers(-(10**400), 10**400),
    st.complex_numbers(),
    st.just(np.float32(0.3)),
)
seens = st.builds(Seen, floats, floats, floats, st.booleans(), floats, floats)
likely = st.builds(
    Seen,
    st.floats(-1, 1),
    st.floats(-0.5, 0.5),
    st.floats(0, 0.2),
    st.just(False),
    st.floats(20, 45),
    st.floats(0, 2e-3),
)
ticks = st.one_of(floats, st.floats(1e-6, 0.03))
steps = st.lists(st.tuples(anything, st.one_of(seens, likely), ticks), min_size=1, max_size=12)


def check(now: Issued, before: Issued, dt: float, envelope: Envelope) -> None:
    """Every hard limit of one tick."""
    assert math.isfinite(now.command)
    assert math.isfinite(now.rate)
    assert envelope.low <= now.command <= envelope.high
    tick = min(dt, LIMITS.longest_tick_s) if dt >= 1e-6 else 0.0
    slack = 1e-12 * (envelope.high - envelope.low)
    if math.isfinite(envelope.rate):
        assert abs(now.command - before.command) <= envelope.rate * tick + slack
        assert abs(now.rate) <= envelope.rate
    if math.isfinite(envelope.acceleration):
        assert abs(now.rate - before.rate) <= envelope.acceleration * tick * (1 + 1e-9) + 1e-9
        stop = now.rate**2 / (2 * envelope.acceleration)
        assert envelope.low - 1e-9 <= now.command + math.copysign(stop, now.rate) <= envelope.high + 1e-9


@given(envelope=st.sampled_from(ENVELOPES), start=floats, inputs=steps)
@example(envelope=ENVELOPES[0], start=0.999, inputs=[(1.8e308, Seen(0.99, 0.0), 0.002)] * 12)
def test_no_input_gets_past_the_limits(
    envelope: Envelope, start: float, inputs: list[tuple[object, Seen, float]]
) -> None:
    previous, _ = limited(math.nan, Issued(start), Seen(math.nan, 0.0), 0.0, envelope)
    assert envelope.low <= previous.command <= envelope.high
    for wanted, seen, dt in inputs:
        now, _ = limited(wanted, previous, seen, dt, envelope)
        check(now, previous, dt, envelope)
        previous = now


@given(
    envelope=st.sampled_from(ENVELOPES), command=floats, rate=floats, aim=floats, wanted=anything, seen=seens, dt=floats
)
def test_any_previous_command_leads_into_the_range(
    envelope: Envelope, command: float, rate: float, aim: float, wanted: object, seen: Seen, dt: float
) -> None:
    now, broken = limited(wanted, Issued(command, rate, aim), seen, dt, envelope)
    assert envelope.low <= now.command <= envelope.high
    assert abs(now.rate) <= envelope.rate
    if not math.isfinite(command):
        assert "previous" in broken


@given(wanted=anything, seen=seens, share=st.floats(-1, 1))
def test_a_blind_or_hot_coil_is_off_and_a_blind_carriage_stands(wanted: object, seen: Seen, share: float) -> None:
    for blind in (
        replace(seen, lost=True),
        replace(seen, age_s=0.2),
        replace(seen, age_s=-1.0),
        replace(seen, position_m=math.nan),
        replace(seen, speed_m_s=math.nan),
        replace(seen, temperature_C=math.nan),
        replace(seen, temperature_C=50.0),
    ):
        coil, broken = limited(wanted, Issued(share * 0.02), blind, 0.02, ENVELOPES[2])
        assert coil.command == 0
        assert {"estimate", "temperature"} & set(broken)
        stands, _ = limited(wanted, Issued(share), blind, 0.002, ENVELOPES[0])
        assert stands.command == share


def test_what_breaks_no_limit_passes_unchanged() -> None:
    envelope, issued, dt = ENVELOPES[0], Issued(0.0), 0.002
    for i in range(2000):
        wanted = 0.004 * (1 - math.cos(3 * i * dt))
        issued, broken = limited(wanted, issued, Seen(wanted - 1e-3, 0.01), dt, envelope)
        assert broken == ()
        assert issued.command == pytest.approx(wanted, abs=1e-12)


def test_a_jump_is_approached_at_full_speed_and_not_overshot() -> None:
    envelope, issued, dt, path = ENVELOPES[0], Issued(0.0), 0.002, []
    for _ in range(200):
        issued, _ = limited(0.005, issued, Seen(issued.command, 0.0), dt, envelope)
        path.append(issued.command)
    assert max(path) <= 0.005 + 1e-9
    assert path[-1] == pytest.approx(0.005, abs=1e-6)
    assert np.argmax(np.array(path) > 0.00495) * dt < 2.5 * math.sqrt(0.005 / 10)


def test_a_running_carriage_stops_within_25_ms_when_the_command_is_lost() -> None:
    envelope, issued, dt = ENVELOPES[0], Issued(0.0), 0.001
    for i in range(60):
        issued, _ = limited(1e-3 * i, issued, Seen(issued.command, 0.0), dt, envelope)
    assert issued.rate == pytest.approx(LIMITS.carriage_speed_m_s)
    for _ in range(25):
        issued, broken = limited(math.nan, issued, Seen(issued.command, 0.0), dt, envelope)
    assert "command" in broken
    assert issued.rate == pytest.approx(0.0, abs=0.011)


def test_the_magnet_does_not_leave_the_gap_that_holds() -> None:
    envelope, issued = ENVELOPES[0], Issued(0.0)
    for _ in range(1000):
        issued, broken = limited(0.5, issued, Seen(0.0, 0.0), 0.002, envelope)
    assert "gap" in broken
    assert issued.command == pytest.approx(0.95 * 0.02 / math.sqrt(3), rel=1e-3)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_gap_holds_on_both_sides_of_a_capsule_that_moves(sign: int) -> None:
    envelope, issued = ENVELOPES[0], Issued(0.0)
    for i in range(1500):
        x = -sign * 5e-6 * i
        issued, _ = limited(sign * 0.5, issued, Seen(x, -sign * 2.5e-3), 0.002, envelope)
        assert abs(issued.command - x) <= envelope.gap_m + 3e-5


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("std", [0.0, 1e-4, 5e-4, 1.0, math.nan])
def test_a_running_carriage_brakes_ahead_of_the_gap_that_the_estimate_is_sure_of(sign: int, std: float) -> None:
    """However far the command jumps beyond: the capsule is within three standard deviations of where it is believed."""
    envelope, issued = ENVELOPES[0], Issued(0.0)
    sure = max(envelope.gap_m - 3 * std, 0.0) if std == std else 0.0
    for i in range(600):
        wanted = 6e-5 * i if i < 150 else 0.5
        issued, broken = limited(sign * wanted, issued, Seen(0.0, 0.0, std_m=std), 0.001, envelope)
        assert abs(issued.command) <= sure + 1e-9
    assert "gap" in broken
    assert abs(issued.command) == pytest.approx(sure, abs=1e-6)


@pytest.mark.parametrize("place", [1.2, -1.2, 1e300])
def test_a_capsule_that_cannot_be_there_is_not_followed(place: float) -> None:
    issued, broken = limited(place, Issued(0.9), Seen(place, 0.0), 0.002, ENVELOPES[0])
    assert "estimate" in broken
    assert issued.command == 0.9


@pytest.mark.parametrize("sign", [1, -1])
def test_a_carriage_at_its_end_goes_no_further_however_fast_it_was(sign: int) -> None:
    envelope = ENVELOPES[0]
    issued, _ = limited(
        sign * 2.0, Issued(sign * envelope.high, sign * envelope.rate), Seen(sign * 1.0, 0.0), 0.002, envelope
    )
    assert issued.command == sign * envelope.high
    assert issued.rate == 0.0


def test_a_current_stays_within_its_range_and_rate() -> None:
    _, broken = limited(1.1, Issued(1.0), Seen(0.0, 0.0), 0.02, ENVELOPES[2])
    assert broken == ("range",)
    issued, broken = limited(1.0, Issued(0.0), Seen(0.0, 0.0), 1e-4, ENVELOPES[2])
    assert issued.command == pytest.approx(0.12)
    assert "rate" in broken


def test_a_strong_magnet_is_held_where_it_pulls_the_force_limit() -> None:
    drive = Magnetic(400.0, 0.05)
    gap = envelope_of(drive).gap_m
    p = {"magnet_stiffness_N_per_m": 400.0}
    assert drive.force(0.0, 0.0, gap, p) == pytest.approx(LIMITS.force_N, rel=1e-9)
    assert gap_of_force(1e9, drive, p, 0.01) == 0.01


@pytest.mark.parametrize(("gain", "speed"), [(0.5, 0.4), (0.5, -0.4), (-2.0, 0.4), (-2.0, -0.4)])
def test_a_capsule_that_is_too_fast_is_braked_but_not_pushed_on(gain: float, speed: float) -> None:
    envelope = envelope_of(Coil(gain))
    for wanted in (0.1, -0.1):
        issued, broken = limited(wanted, Issued(0.0), Seen(0.0, speed), 0.02, envelope)
        pushes_on = wanted * gain * speed > 0
        assert issued.command == (0.0 if pushes_on else wanted)
        assert ("speed" in broken) == pushes_on


def test_current_falls_off_with_heat() -> None:
    envelope = ENVELOPES[2]
    found = [
        limited(1.0, Issued(1.0), Seen(0.0, 0.0, temperature_C=t), 0.02, envelope)[0].command
        for t in (20.0, 41.0, 42.0, 43.0)
    ]
    assert found == pytest.approx([1.0, 1.0, 0.5, 0.0])


def test_every_limit_has_a_meaning_and_a_source() -> None:
    assert all(re.fullmatch(r".+ \(.+\)", f.metadata["meaning"]) for f in fields(Limits))


@pytest.mark.parametrize(
    "wrong", [{"force_N": 0.0}, {"current_A": math.nan}, {"gap_share": 1.1}, {"derate_C": 60.0}, {"age_s": True}]
)
def test_limits_that_limit_nothing_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"limit {next(iter(wrong))} must be"):
        Limits(**wrong)


@pytest.mark.parametrize("name", sorted({*Limits.ranges()} - {"temperature_C", "derate_C"}))
def test_a_limit_cannot_be_set_so_high_that_it_limits_nothing(name: str) -> None:
    least, most = Limits.ranges()[name]
    for value in (least, most):
        assert getattr(Limits(**{name: value}), name) == value
    for value in (0.5 * least - 1e-9, 1.01 * most, 1e300):
        with pytest.raises(ValueError, match=f"limit {name} must be a number from"):
            Limits(**{name: value})


def test_an_imposed_motion_has_no_command_to_limit() -> None:
    with pytest.raises(ValueError, match="drive must be magnetic, coil or vibro"):
        envelope_of(Pull())


def test_number_takes_numbers_only() -> None:
    assert number(np.float32(0.5)) == 0.5
    assert all(math.isnan(number(value)) for value in ("1", None, 1j, 10**400, [1.0]))
