"""What `check` says of a machine: settings of the interface from what `ip` tells, and the tick that it holds."""

import math
import os
import socket
from typing import Any

import can
import pytest

from hil.app.run import check, machine
from hil.app.run.clock import Histogram
from hil.app.run.machine import (
    lateness,
    link_advice,
    link_faults,
    link_of,
    prepare_process,
    priority_words,
    tick_to_hold,
)
from hil.app.scenario.deployment import parse_deployment
from hil.app.scenario.deployment_tables import BusTable, ControlTable
from hil.bus.local import LocalBus
from models.theta import Theta
from tests.hil.app.run.deployments import deployment

TABLE = BusTable(interface="socketcan", channel="can0", fd=True)


def link(txqlen: int = 10, **data: Any) -> dict[str, Any]:
    """As `ip -json -details link show can0` has it."""
    return {"ifname": "can0", "txqlen": txqlen, "linkinfo": {"info_kind": "can", "info_data": data}}


def test_an_interface_as_the_kernel_makes_it_is_told_what_it_lacks() -> None:
    fresh = link(bittiming={"bitrate": 1_000_000}, data_bittiming={"bitrate": 2_000_000}, restart_ms=0)
    assert link_faults(fresh, TABLE) == ["data_bittiming of can0 must be 5000000; got 2000000"]
    assert link_advice(fresh, TABLE) == [
        "queue of 10 frames: ip link set can0 txqueuelen 128",
        "no restart after bus-off: ip link set can0 type can restart-ms 100, while the interface is down",
    ]
    assert link_faults(link(bittiming={"bitrate": 500_000}), BusTable(interface="socketcan", channel="can0")) == [
        "bittiming of can0 must be 1000000; got 500000"
    ]
    good = link(1000, bittiming={"bitrate": 1_000_000}, data_bittiming={"bitrate": 5_000_000}, restart_ms=100)
    assert link_faults(good, TABLE) == link_advice(good, TABLE) == []


def test_a_virtual_interface_and_none_are_left_alone() -> None:
    virtual = {"ifname": "vcan0", "txqlen": 1000, "linkinfo": {"info_kind": "vcan"}}
    assert link_faults(virtual, TABLE) == link_advice(virtual, TABLE) == []
    assert link_of(BusTable(interface="socketcan", channel="nocan9")) == {}
    assert link_of(BusTable(interface="capsule_local", channel="x")) == {}
    assert link_faults({}, TABLE) == link_advice({}, TABLE) == []


def histogram(*seconds: float) -> Histogram:
    found = Histogram()
    for one in seconds:
        found.add(one)
    return found


def test_the_tick_that_is_held() -> None:
    assert tick_to_hold(histogram(*[5e-5] * 200), 2e-4, 0.5) == 5e-4
    assert tick_to_hold(histogram(*[5e-5] * 200), 9e-4, 0.5) == 2e-3
    assert tick_to_hold(histogram(*[5e-5] * 200, 3e-3), 2e-4, 0.5) == 4e-3, "the longest counts"
    assert math.isinf(tick_to_hold(histogram(0.05), 2e-4, 0.5))
    assert lateness(0.02).counts.sum() == 20


@pytest.mark.parametrize(
    ("took_s", "good", "said"), [(2e-4, True, ""), (1.6e-3, True, "tick_s = 4 ms leaves half"), (2.2e-3, False, "miss")]
)
def test_a_tick_is_bad_where_a_run_would_miss_it(
    monkeypatch: pytest.MonkeyPatch, took_s: float, good: bool, said: str
) -> None:
    """More than half of a tick is advice: `run` keeps its grid with it."""
    monkeypatch.setattr(check, "rehearse", lambda _: histogram(*[took_s] * 200))
    monkeypatch.setattr(machine, "lateness", lambda: histogram(*[1e-4] * 200))
    point = check._time(parse_deployment(deployment(), Theta()), parse_deployment(deployment(), Theta()).task())
    assert (point.good, said in point.words) == (good, True)
    assert ("control.tick_s = " in point.words) == (took_s > 1e-3)


def test_priority_is_tried_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    before = os.sched_getscheduler(0)
    priority_words(ControlTable(priority=20))
    assert os.sched_getscheduler(0) == before

    def refused(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refused)
    assert priority_words(ControlTable(priority=20)).startswith("real-time priority 20 is not available")


def test_a_system_without_such_sockets_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(socket, "SOCK_SEQPACKET")
    with pytest.raises(can.CanInitializationError, match="which this system lacks; use interface udp_multicast"):
        LocalBus("none")


def test_a_system_without_real_time_scheduling_is_told_of_and_led_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_setscheduler")
    monkeypatch.delattr(os, "sched_setaffinity")
    assert priority_words(ControlTable(priority=20)) == "this system has no real-time priority"
    assert priority_words(ControlTable()) == ""
    monkeypatch.setattr(machine, "_lock_memory", lambda: None)
    monkeypatch.setattr(machine.gc, "freeze", lambda: None)
    assert prepare_process(20, 0) == [
        f"{what} is not available: this system does not have it" for what in ("core 0", "priority 20")
    ]
