"""This machine: its CAN interface, opened and checked, its real-time priority, its time stamps, its shortest tick."""

import ctypes
import gc
import json
import logging
import math
import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import can

from hil.app.run.clock import Clock, ClockedBus, Grid, Histogram
from hil.app.scenario.deployment_tables import BusTable, ControlTable
from hil.bus.authenticated import AuthenticatedBus, authenticator, next_epoch, read_key
from hil.own_process import error_text
from models.files.toml import check_word
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
TIMED: Final = ("pcan", "kvaser", "vector")  # Interfaces whose CAN FD bit timing python-can sets
_DRIVERS = logging.getLogger("can")  # Log of python-can and its drivers; only their errors are reported
QUEUE: Final = 128  # Frames that the interface should hold: a tick's of all nodes, several times
RESTART_MS: Final = 100  # after a bus-off
LOOKED_S: Final = 0.4  # for which the machine's lateness is measured
TICKS_S: Final = (5e-4, 1e-3, 2e-3, 4e-3, 5e-3, 8e-3, 1e-2, 2e-2)  # that a deployment can have
_STEP_S: Final = 1e-3  # of that measurement
_MCL_CURRENT_AND_FUTURE: Final = 3  # of mlockall(2)
_IP_S: Final = 5  # for which `ip` may run


def open_bus(table: BusTable, folder: Path = Path()) -> can.BusABC:
    """The bus of a file in `folder`, authenticated where the file names a key. Raises ValueError of one sentence."""
    if not table.key_file:
        return _plain_bus(table)
    key_file = folder / table.key_file
    key = read_key(key_file)
    authenticator(key)
    inner = _plain_bus(table)
    try:
        return AuthenticatedBus(inner, key, next_epoch(key_file))
    except ValueError:
        inner.shutdown()
        raise


def _plain_bus(table: BusTable) -> can.BusABC:
    if not _DRIVERS.handlers:
        _DRIVERS.addHandler(logging.NullHandler())
    check_word(table.interface, "bus.interface", sorted(can.VALID_INTERFACES))
    try:
        return can.Bus(
            interface=table.interface, channel=None if table.channel == "" else table.channel, **_rate(table)
        )
    except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
        fd = f" dbitrate {table.data_bitrate} fd on" if table.fd else ""
        points = f" sample-point {table.sample_point:g} dsample-point {table.data_sample_point:g}" if fd else ""
        up = f"ip link set {table.channel} up type can bitrate {table.bitrate}{points}{fd}"
        socketcan = table.interface == "socketcan" and table.channel != ""
        remedy = f"; '{up}' brings it up, in a kernel with CAN" if socketcan else ""
        raise ValueError(
            f"bus must be one that opens; got {table.interface} {table.channel!r}: {error_text(error)}{remedy}"
        ) from None


def _rate(table: BusTable) -> dict[str, Any]:
    """Bit rates for python-can: makers' adapters take a CAN FD timing; of SocketCAN the kernel sets it."""
    if not table.fd:
        return {"bitrate": table.bitrate}
    if table.interface in TIMED:
        return {"fd": True, "timing": table.timing()}
    if table.interface == "socketcan":
        mtu = Path(f"/sys/class/net/{table.channel}/mtu")
        if mtu.is_file() and mtu.read_text(encoding="ascii").strip() == "16":
            raise can.CanInitializationError("the interface is up for classic CAN alone")
    return {"fd": True, "bitrate": table.bitrate, "data_bitrate": table.data_bitrate}


def link_of(table: BusTable) -> dict[str, Any]:
    """What `ip -json -details link show` says of a SocketCAN interface; empty where it says nothing."""
    if table.interface != "socketcan":
        return {}
    command = ["ip", "-json", "-details", "link", "show", str(table.channel)]
    try:
        found = json.loads(subprocess.run(command, capture_output=True, timeout=_IP_S, check=True).stdout)[0]
    except (OSError, subprocess.SubprocessError, ValueError, LookupError):
        return {}
    return dict(found) if isinstance(found, dict) else {}


def link_faults(link: Mapping[str, Any], table: BusTable) -> list[str]:
    """Where the interface is not as the deployment file says: bit rates. A virtual one has none."""
    data = _data(link)
    wanted = [("bittiming", table.bitrate)]
    wanted += [("data_bittiming", table.data_bitrate)] if table.fd else []
    rates = [(name, rate, data.get(name, {}).get("bitrate")) for name, rate in wanted]
    return [
        f"{name} of {table.channel} must be {rate}; got {got}" for name, rate, got in rates if got not in (None, rate)
    ]


def link_advice(link: Mapping[str, Any], table: BusTable) -> list[str]:
    data, advice = _data(link), []
    queue, restart = link.get("txqlen"), data.get("restart_ms", 0)
    if isinstance(queue, int) and queue < QUEUE:
        advice.append(TEXT("machine.queue", frames=queue, channel=table.channel, wanted=QUEUE))
    if "bittiming" in data and not restart:
        advice.append(TEXT("machine.restart", channel=table.channel, ms=RESTART_MS))
    return advice


def _data(link: Mapping[str, Any]) -> Mapping[str, Any]:
    found = link.get("linkinfo", {}).get("info_data", {})
    return found if isinstance(found, dict) else {}


def priority_words(control: ControlTable) -> str:
    if not hasattr(os, "sched_setscheduler"):
        return TEXT("machine.no_priority") if control.priority else ""
    wanted = control.priority or 1
    with as_a_run(wanted, -1) as taken:
        if not taken:
            return TEXT("machine.priority_refused", priority=wanted)
    return "" if control.priority else TEXT("machine.priority_unused")


@contextmanager
def as_a_run(priority: int, core: int) -> Iterator[bool]:
    """The scheduler and core that a run asks for, for the time of the block; whether they are available."""
    if not hasattr(os, "sched_setscheduler"):
        yield False
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)
    taken = False
    with suppress(OSError):
        os.sched_setaffinity(0, {core} if core >= 0 else before[2])
        if priority:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
        taken = True
    try:
        yield taken
    finally:
        os.sched_setaffinity(0, before[2])
        if taken:
            os.sched_setscheduler(0, *before[:2])


def lateness(seconds: float = LOOKED_S) -> Histogram:
    """How late this process wakes when it sleeps from one ms to the next."""
    grid = Grid(Clock(), _STEP_S)
    for _ in range(round(seconds / _STEP_S)):
        grid.wait()
    return grid.late


def tick_to_hold(late: Histogram, busy_p99_s: float, share: float) -> float:
    """The shortest of `TICKS_S` in which work takes at most `share` and no wake-up is a tick late; inf: none."""
    late_s = late.quantile(0.99)
    fit = (t for t in TICKS_S if busy_p99_s <= share * t and late_s + busy_p99_s <= t and late.longest_s < t)
    return next(fit, math.inf)


def stamp_words(table: BusTable, bus: ClockedBus) -> str:
    key = f"stamps.{table.interface}"
    said = TEXT("machine.stamps", clock=TEXT(key if key in TEXT else "stamps.other"))
    return said + (TEXT("machine.unstamped", frames=bus.unstamped) if bus.unstamped else "")


def _lock_memory() -> None:
    """Keep all pages of this process in memory, those to come too."""
    if ctypes.CDLL(None, use_errno=True).mlockall(_MCL_CURRENT_AND_FUTURE):
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def prepare_process(priority: int, core: int) -> list[str]:
    """Freeze the heap, take one `core` and SCHED_FIFO of `priority`; a sentence for each that is refused."""
    gc.collect()
    gc.freeze()
    wishes: dict[str, Callable[[], Any]] = {}
    if core >= 0:
        wishes[f"core {core}"] = lambda: os.sched_setaffinity(0, {core})
    if priority > 0:
        wishes["locked memory"] = _lock_memory
        wishes[f"priority {priority}"] = lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    refused: list[str] = []
    for what, wish in wishes.items():
        try:
            wish()
        except (OSError, AttributeError) as error:
            why = error.strerror or str(error) if isinstance(error, OSError) else TEXT("machine.unknown")
            refused.append(TEXT("machine.refused", what=what, why=why))
    return refused
