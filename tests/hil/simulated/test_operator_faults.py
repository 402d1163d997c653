"""What goes wrong with an operator: the reference is held while the last setpoint lives at most, the drive stopped
after it, and nobody leads who has not pressed. And what the judge says where a protection is gone.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.sil.fault_outcomes import PRESSED, SOURCE, WANTED, FaultOutcome, hold_s, outcomes
from hil.app.sil.loop import SilTrace
from hil.bus.protection import Receiver
from hil.nodes.operator import Lateness, Operator, OperatorLimits
from hil.simulated.faults import Fault
from tests.hil.app.sil.sil_runs import JOG, RIGS, run, scenario_of

AT_S, DURATION_S = 0.305, 0.2
TICK_S = 2e-3


def spoiled(kind: str, target: str = "", *more: dict[str, Any], **tables: Any) -> tuple[SilTrace, FaultOutcome]:
    """A run in which an operator steers and something goes wrong."""
    fault = {"kind": kind, "at_s": AT_S, "duration_s": DURATION_S, "target": target}
    trace, found = run("magnetic", AT_S + DURATION_S + 0.1, fault, *more, **tables)
    return trace, found[0]


@pytest.mark.parametrize(
    ("kind", "target", "reason"),
    [
        ("drop", "setpoints", ""),
        ("delay", "setpoints", "not_released"),
        ("held_back", "", "late"),
        ("corrupt", "setpoints", "crc"),
        ("retyped", "setpoints", ""),
        ("frozen_setpoint", "", "repeated"),
        ("miscounted", "", "counter"),
        ("out_of_range", "", "range"),
        ("released", "", ""),
    ],
)
def test_held_then_stopped_and_not_led_again(kind: str, target: str, reason: str) -> None:
    """In charge up to the fault, held by when the last setpoint has lived, at rest and off by 50 ms later, and so it
    stays although the operator's switch is still held.
    """
    trace, outcome = spoiled(kind, target)
    t = TICK_S * np.arange(len(trace.steered))
    wanted, source = trace.steered[:, WANTED], trace.steered[:, SOURCE]
    assert source[t < AT_S][-1] == 5
    assert np.all(np.diff(wanted[(t > 0.2) & (t < AT_S)]) > 0)
    scenario = scenario_of("magnetic", 1.0, {"kind": "released", "at_s": 0.3})
    assert scenario.jog is not None
    assert scenario.operator is not None
    last_s = hold_s(scenario.jog, scenario.operator, outcome.fault)
    held = AT_S + last_s
    assert np.ptp(wanted[t > held + 2 * TICK_S]) == 0
    assert not source[t > held + 2 * TICK_S].any()
    assert 0.02 < outcome.safe_after_s <= last_s + 0.05 + 0.02
    assert not outcome.unsafe
    assert trace.slots[trace.slots[:, 0] > AT_S + outcome.safe_after_s, 1].all()
    assert trace.operator is not None
    assert trace.operator["presses"] == 1
    refused = trace.operator["refused"]
    assert isinstance(refused, dict)
    assert refused.get(reason, 0) > 1 or not reason


@pytest.mark.parametrize(("kind", "target"), [("duplicate", "setpoints"), ("reorder", "setpoints")])
def test_setpoints_that_come_twice_or_in_another_order_are_ridden_through(kind: str, target: str) -> None:
    trace, outcome = spoiled(kind, target)
    assert math.isnan(outcome.safe_after_s)
    assert np.diff(trace.steered[100:, WANTED]) == pytest.approx(3e-3 * TICK_S)


def test_old_setpoints_are_not_followed_and_an_old_release_is_a_release() -> None:
    trace, outcome = spoiled("replay", "setpoints")
    assert not outcome.unsafe
    assert trace.steered[-1, WANTED] < 3e-3 * (AT_S - 0.1)


def test_more_than_is_allowed_is_not_done() -> None:
    """0.4 m/s asked for, 5 mm/s done; judged by a tighter limit the same run is unsafe."""
    trace, outcome = spoiled("beyond_limits", "setpoints")
    t = TICK_S * np.arange(len(trace.steered))
    during = (t > AT_S) & (t < AT_S + DURATION_S)
    assert np.max(np.diff(trace.steered[during, WANTED])) == pytest.approx(5e-3 * TICK_S, rel=1e-6)
    assert not outcome.unsafe
    fault = {"kind": "beyond_limits", "at_s": AT_S, "duration_s": DURATION_S}
    free = {"accept": True, "stop_after_s": 0.05, "speed_m_s": 0.05, "acceleration_m_s2": 0.5}
    loose, _ = run("magnetic", 0.6, fault, operator=free)
    tight = replace(scenario_of("magnetic", 0.6, fault), operator=OperatorLimits(accept=True))
    assert outcomes(tight, loose)[0].unsafe


def test_a_second_operator_is_refused() -> None:
    trace, outcome = spoiled("second_operator", "other")
    assert not outcome.unsafe
    assert set(trace.steered[20:, SOURCE]) == {5}
    assert np.diff(trace.steered[100:, WANTED]) == pytest.approx(3e-3 * TICK_S)
    assert trace.operator is not None
    assert trace.operator["refused"]["busy"] > 5  # type: ignore[index]


def test_a_second_sender_of_the_same_source_ends_the_charge() -> None:
    """It begins with the release of its switch, and that counts whatever its counter."""
    trace, (outcome,) = run("magnetic", 0.7, {"kind": "second_operator", "at_s": 0.385, "target": "same"})
    assert not outcome.unsafe
    assert outcome.safe_after_s < 0.1
    assert trace.steered[-1, SOURCE] == 0
    assert np.all(np.diff(trace.steered[100:, WANTED]) >= 0)


def test_a_second_sender_whose_counters_fit_does_not_lead_on() -> None:
    """Begun at another time its counters go on from the first one's. Its release holds the capsule all the same, and
    its press counts no more than the first one's, which is still held.
    """
    trace, (outcome,) = run("magnetic", 0.6, {"kind": "second_operator", "at_s": AT_S, "target": "same"})
    t = TICK_S * np.arange(len(trace.steered))
    assert np.ptp(trace.steered[t > 0.39, WANTED]) == 0
    assert not trace.steered[t > 0.39, SOURCE].any()
    assert not outcome.unsafe
    assert outcome.safe_after_s < 0.1


@pytest.mark.parametrize("kind", ["drop", "delay"])
def test_without_a_time_to_live_it_would_be_unsafe(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Operator, "expire", lambda *_: None)
    assert spoiled(kind, "setpoints")[1].unsafe


def test_without_the_counter_as_a_clock_it_would_be_unsafe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Lateness, "heard", lambda *_: 0.0)
    assert spoiled("held_back")[1].unsafe


@pytest.mark.parametrize("kind", ["frozen_setpoint", "miscounted"])
def test_without_counters_it_would_be_unsafe(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Receiver, "_step", lambda *_: 1)
    monkeypatch.setattr(Lateness, "heard", lambda *_: 0.0)
    assert spoiled(kind)[1].unsafe


def test_without_the_stop_it_would_be_unsafe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Operator, "resting", lambda *_: False)
    assert spoiled("released")[1].unsafe


def without(name: str, value: Any) -> Callable[[Operator, Any, Any], None]:
    """`Operator.begin` that also sets an attribute."""
    begin = Operator.begin

    def changed(self: Operator) -> None:
        begin(self)
        setattr(self, name, value)

    return changed  # type: ignore[return-value]


def test_a_charge_that_nobody_pressed_for_is_unsafe(monkeypatch: pytest.MonkeyPatch) -> None:
    """All sources armed for ever: the operator whose setpoints were lost leads again without a press."""

    class Always(set[int]):
        def discard(self, _: int) -> None:
            """Nobody has to release."""

    monkeypatch.setattr(Operator, "begin", without("_armed", Always({5})))
    assert spoiled("drop", "setpoints")[1].unsafe


def test_pressed_again_after_a_release_it_goes_on_and_that_is_not_unsafe() -> None:
    """Lost for 0.2 s, released by hand once they are heard again, pressed, and led again."""
    jog = {**JOG, "script": ["release 0.02", "speed 3 0.6", "release 0.1", "speed 3 9"]}
    fault = {"kind": "drop", "at_s": AT_S, "duration_s": DURATION_S, "target": "setpoints"}
    trace, (outcome,) = run("magnetic", 1.1, fault, jog=jog)
    assert not outcome.unsafe
    assert trace.steered[-1, SOURCE] == 5
    assert trace.steered[-1, PRESSED] == 2
    assert not trace.slots[-1, 1]


def test_a_fault_of_an_operator_needs_one() -> None:
    assert Fault("drop", 0.3, target="setpoints").needs == Fault("released", 0.3).needs == "operator"
    raw = {"scenario": {"name": "a", "duration_s": 1.0}, **RIGS["magnetic"]}
    with pytest.raises(ValueError, match=r"faults\.kind drop setpoints must stand with the table \[jog\]"):
        parse_sil_scenario({**raw, "faults": [{"kind": "drop", "at_s": 0.3, "target": "setpoints"}]})


def test_a_drive_is_not_enabled_for_one_who_has_let_go() -> None:
    """Released while the drive still tests itself: it stands by."""
    trace, (outcome,) = run("magnetic", 0.4, {"kind": "released", "at_s": 0.035})
    assert trace.steered[20, SOURCE] == 5 or trace.steered[19, SOURCE] == 5
    assert trace.slots[:, 1].all()
    assert not outcome.unsafe


@pytest.mark.parametrize("kind", ["drop", "released"])
@pytest.mark.parametrize("rig", RIGS)
def test_in_time_wherever_in_the_operators_cycle_it_begins(rig: str, kind: str) -> None:
    """A setpoint comes every 20 ms; the longest time is from just after one."""
    target = "setpoints" if kind == "drop" else ""
    worst = 0.0
    for part in range(10):
        fault = {"kind": kind, "at_s": 0.2005 + 2e-3 * part, "target": target}
        _, (outcome,) = run(rig, 0.45, fault)
        assert not outcome.unsafe
        worst = max(worst, outcome.safe_after_s)
    assert 0.07 < worst <= (0.115 if kind == "drop" else 0.09)
