"""What this machine lacks for a controller: settings of the CAN interface, priority, time stamps; its tick."""

import ctypes
import gc
import json
import os
import subprocess
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from hil.app.run.clock import ClockedBus, Histogram
from hil.app.scenario.deployment import BusTable, ControlTable

QUEUE: Final = 128
"""Frames that the interface should hold: a tick's of all nodes, several times."""
RESTART_MS: Final = 100  # after a bus-off
LOOKED_S: Final = 0.4  # for which the machine's lateness is measured
TICKS_S: Final = (5e-4, 1e-3, 2e-3, 4e-3, 5e-3, 8e-3, 1e-2, 2e-2)  # that a deployment can have
_STEP_S: Final = 1e-3  # of that measurement
_MCL_CURRENT_AND_FUTURE: Final = 3  # of mlockall(2)
_IP_S: Final = 5  # for which `ip` may run
_STAMPS: Final = {
    "socketcan": "the kernel's, as the driver hands a frame over; not the hardware's",
    "capsule_local": "the sender's clock",
    "udp_multicast": "the kernel's, as a packet arrives",
}


def link_of(table: BusTable) -> dict[str, Any]:
    """What `ip -json -details link show` says of a SocketCAN interface; empty where it says nothing."""
    if table.interface != "socketcan":
        return {}
    command = ["ip", "-json", "-details", "link", "show", str(table.channel)]
    try:
        told = subprocess.run(command, capture_output=True, timeout=_IP_S, check=True).stdout
        found = json.loads(told)[0]
    except (OSError, subprocess.SubprocessError, ValueError, LookupError):
        return {}
    return dict(found) if isinstance(found, dict) else {}


def link_faults(link: Mapping[str, Any], table: BusTable) -> list[str]:
    """Where the interface is not as the deployment file says: bit rates. A virtual one has none."""
    told = _data(link)
    wanted = [("bittiming", table.bitrate)]
    wanted += [("data_bittiming", table.data_bitrate)] if table.fd else []
    rates = [(name, rate, told.get(name, {}).get("bitrate")) for name, rate in wanted]
    return [
        f"{name} of {table.channel} must be {rate}; got {got}" for name, rate, got in rates if got not in (None, rate)
    ]


def link_advice(link: Mapping[str, Any], table: BusTable) -> list[str]:
    told, advice = _data(link), []
    queue, restart = link.get("txqlen"), told.get("restart_ms", 0)
    if isinstance(queue, int) and queue < QUEUE:
        advice.append(f"a queue of {queue} frames: ip link set {table.channel} txqueuelen {QUEUE}")
    if "bittiming" in told and not restart:
        advice.append(
            f"no return after bus-off: ip link set {table.channel} type can restart-ms {RESTART_MS}, while it is down"
        )
    return advice


def _data(link: Mapping[str, Any]) -> Mapping[str, Any]:
    found = link.get("linkinfo", {}).get("info_data", {})
    return found if isinstance(found, dict) else {}


def priority_words(control: ControlTable) -> str:
    """Whether the real-time priority that is asked for is to be had."""
    if not hasattr(os, "sched_setscheduler"):
        return "this system has no real-time priority to ask for" if control.priority else ""
    wanted = control.priority or 1
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(wanted))
    except OSError:
        return (
            f"real-time priority {wanted} is not to be had: as root, with CAP_SYS_NICE, or with 'rtprio 99' and"
            " 'memlock unlimited' for this user in /etc/security/limits.conf"
        )
    os.sched_setscheduler(0, *before)
    return "" if control.priority else "real-time priority is to be had and not asked for: control.priority = 20"


def lateness(seconds: float = LOOKED_S) -> Histogram:
    """How late this process is as it sleeps from one ms to the next."""
    late, due = Histogram(), time.perf_counter()
    for _ in range(round(seconds / _STEP_S)):
        due += _STEP_S
        time.sleep(max(due - time.perf_counter(), 0.0))
        late.add(max(time.perf_counter() - due, 0.0))
        due = max(due, time.perf_counter() - _STEP_S)
    return late


def tick_to_hold(late: Histogram, busy_p99_s: float, share: float) -> float:
    """The shortest of `TICKS_S` of which work is at most `share` and lateness less than one; inf: none."""
    return next(
        (
            t
            for t in TICKS_S
            if busy_p99_s <= share * t and late.quantile(0.99) + busy_p99_s <= t and late.longest_s < t
        ),
        float("inf"),
    )


def stamp_words(table: BusTable, bus: ClockedBus) -> str:
    """Whose the time stamps of received frames are."""
    whose = _STAMPS.get(table.interface, "the driver's")
    return f"{whose}; {bus.unstamped} frames had none of use and count from being read" if bus.unstamped else whose


def _lock_memory() -> None:
    """Keep all pages of this process in memory, those to come too."""
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def prepare_process(priority: int, core: int) -> list[str]:
    """Freeze the heap, take one `core` and SCHED_FIFO of `priority`; a sentence for each that is not allowed."""
    gc.collect()
    gc.freeze()
    refused: list[str] = []
    wishes: list[tuple[str, Callable[[], Any]]] = []
    if core >= 0:
        wishes.append((f"core {core}", lambda: os.sched_setaffinity(0, {core})))
    if priority > 0:
        wishes.append(("memory that stays", _lock_memory))
        wishes.append(
            (f"priority {priority}", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority)))
        )
    for what, wish in wishes:
        try:
            wish()
        except OSError as error:
            refused.append(f"{what} is not to be had: {error.strerror or error}")
        except AttributeError:
            refused.append(f"{what} is not to be had on this system")
    return refused
