"""`capsule run`: the controller alone, on a real actuator bus."""

from __future__ import annotations

import logging
from pathlib import Path

import can

from hil.app.console import notes, output_to_notes, print_json, summary
from hil.app.run.check import check, limits_point, rehearse
from hil.app.run.clock import Clock, ClockedBus
from hil.app.run.loop import Outcome, Signals, lead, prepare_process
from hil.app.scenario.deployment import BusTable, Deployment, load_deployment
from hil.app.scenario.model_health import health_words
from hil.app.scenario.model_health import told as health_told
from hil.app.scenario.model_offer import offer_words, told
from hil.app.write import check_file, check_targets
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.log.log import FrameLog, keep_older, record_path
from hil.log.recorder import Recorder, log_record
from hil.nodes.cia402.bus import Cia402Bus
from hil.nodes.cia402.setup import set_up
from hil.nodes.controller.node import ControllerNode
from hil.nodes.frame_map import frame_map_of
from models.parameter import nearest

ACTIONS = ("lead", "check", "reset")
_DRIVERS = logging.getLogger("can")
"""What drivers say beside their errors; the errors alone are told."""


def run(
    path: Path, action: str = "lead", *, dry_run: bool = False, log: Path | None = None, json_output: bool = False
) -> int:
    """Lead the drive that the rig file `path` names, or only check; 0 where all went as asked, 1 where it did not.

    The action "reset" leads too, and acknowledges first a fault that the drive has latched: that takes an operator's
    word. With `dry_run` everything is listened to and computed and nothing is sent. Raises ValueError, one sentence,
    for what cannot be used.
    """
    if action not in ACTIONS:
        raise ValueError(f"action must be one of {', '.join(ACTIONS)}; got {action!r}; {nearest(action, ACTIONS)}")
    deployment, catalogue = load_deployment(path), load_catalogue()
    log = log or Path(f"{deployment.name}.blf")
    if action != "check":
        check_targets([check_file(log, "--log", (".blf",)), record_path(log)], "--log", [path])
    verdict = deployment.verdict
    if action != "check" and verdict is not None and not verdict.passed and not dry_run:
        raise ValueError(f"{path}: model must pass the gate before it leads; got: {verdict.sentence}")
    limits = limits_point(deployment.limits, deployment.rig.kind, catalogue)
    if action != "check" and not limits.good:
        raise ValueError(f"{path}: {limits.words}")
    with output_to_notes():
        task = deployment.task()
        try:
            bus = ClockedBus(_drives_bus(deployment, listen_only=dry_run or action == "check"), Clock())
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        try:
            if action == "check":
                points = check(deployment, task, bus, catalogue)
            else:
                outcome, node, frames_log = _lead(deployment, bus, dry_run, log, reset=action == "reset")
        finally:
            bus.shutdown()
    if action == "check":
        if json_output:
            print_json({"rig": str(path), "good": all(p.good for p in points), "points": [vars(p) for p in points]})
        for point in () if json_output else points:
            summary().print(
                f"{'ok ' if point.good else 'BAD'} {point.what}: {point.words}", markup=False, soft_wrap=True
            )
        return 0 if all(p.good for p in points) else 1
    found = _document(path, outcome, node, frames_log, dry_run) | {"overruns": _overruns(bus)}
    found |= told(deployment.offered, node.estimator.taken_at)
    found["monitor"] = health_told(node.estimator.health, node.estimator.origin_s)
    if json_output:
        print_json(found)
    else:
        _say(found)
    return 0 if outcome.well or (dry_run and outcome.led) else 1


def open_bus(table: BusTable) -> can.BusABC:
    """The bus that `[bus]` names. Raises ValueError of one sentence where there is none."""
    if not _DRIVERS.handlers:
        _DRIVERS.addHandler(logging.NullHandler())
    if table.interface not in can.VALID_INTERFACES:
        known = sorted(can.VALID_INTERFACES)
        raise ValueError(
            f"bus.interface must be one of {', '.join(known)}; got {table.interface!r};"
            f" {nearest(table.interface, known)}"
        )
    try:
        return can.Bus(
            interface=table.interface, channel=None if table.channel == "" else table.channel, bitrate=table.bitrate
        )
    except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
        words = " ".join(str(error).split())[:200] or type(error).__name__
        up = (
            f"; 'ip link set {table.channel} up type can bitrate {table.bitrate}' brings it up, in a kernel that"
            " knows CAN"
        )
        remedy = up if table.interface == "socketcan" and table.channel != "" else ""
        raise ValueError(
            f"bus must be one that opens; got {table.interface} {table.channel!r}: {words}{remedy}"
        ) from None


def _drives_bus(deployment: Deployment, *, listen_only: bool) -> can.BusABC:
    """The deployment's bus; a CiA 402 drive on it is set up first, but where nothing may be sent. Raises ValueError of
    one sentence.
    """
    bus, table = open_bus(deployment.bus), deployment.cia402
    if table is None:
        return bus
    if not listen_only:
        try:
            shortest_ms = frame_map_of(deployment.rig.kind).life_ms(deployment.limits.carriage_speed_m_s)
            set_up(bus, table, deployment.limits, deployment.control.tick_s, shortest_ms)
        except ValueError:
            bus.shutdown()
            raise
    return Cia402Bus(bus, table, load_catalogue())


def _lead(
    deployment: Deployment, bus: ClockedBus, dry_run: bool, path: Path, *, reset: bool
) -> tuple[Outcome, ControllerNode, FrameLog]:
    task, catalogue, control = deployment.task(), load_catalogue(), deployment.control
    record = log_record(
        {"deployment": deployment.text},
        control.controller,
        deployment.values,
        deployment.limits,
        catalogue,
        dry_run=dry_run,
        bus=vars(deployment.bus),
        offered=deployment.offered and deployment.offered.document(),
        clock_origin_ns=bus.clock.origin_ns,
    )
    rehearse(task, catalogue)
    older = keep_older(path)
    if older is not None:
        notes().print(f"older log kept as {older}", markup=False, soft_wrap=True)
    with FrameLog(path, record) as frames_log, Signals().caught() as signals:
        recorder = Recorder(frames_log, dry_run)
        node = ControllerNode(task, bus, catalogue=catalogue, observer=recorder, dry_run=dry_run)
        refused = prepare_process(control.priority, control.core)
        if control.priority > 0 and not refused:
            frames_log.hasten(1)
        for sentence in refused:
            notes().print(sentence, markup=False)
        notes().print(f"{deployment.name}: leading for {control.duration_s:g} s; Ctrl-C stops", markup=False)
        outcome = lead(node, bus.clock, control.duration_s, recorder, signals, reset=reset)
    return outcome, node, frames_log


def _document(
    path: Path, outcome: Outcome, node: ControllerNode, frames_log: FrameLog, dry_run: bool
) -> dict[str, object]:
    grid = outcome.grid
    return {
        "rig": str(path),
        "controller": node.task.controller,
        "dry_run": dry_run,
        "ended": outcome.ended,
        "led": outcome.led,
        "ticks": grid.ticks,
        "missed_ticks": grid.missed,
        "cut_ticks": outcome.cut,
        "late_ms": grid.late.document(),
        "tick_ms": outcome.busy.document(),
        "rejected": node.receiver.rejected,
        "refused": sum(node.guard.refused.values()),
        "unsent": node.guard.unsent,
        "log": str(frames_log.path),
        "log_dropped": frames_log.dropped,
    }


def _overruns(bus: can.BusABC) -> int:
    """Frames for which there was no room in another node's queue, as far as the interface counts them: the local bus
    does.
    """
    while isinstance(bus, ClockedBus | Cia402Bus):
        bus = bus.inner
    return bus.overruns if isinstance(bus, LocalBus) else 0


def _say(found: dict[str, object]) -> None:
    console = summary()
    console.print(
        f"{found['controller']}: {found['ticks']} ticks, {found['missed_ticks']} missed; ended: {found['ended']}",
        markup=False,
    )
    for name, words in (("late_ms", "began late by"), ("tick_ms", "took")):
        times = found[name]
        assert isinstance(times, dict)
        console.print(
            f"ticks {words} ms: median {times['median']:.3f}, p99 {times['p99']:.3f}, max {times['max']:.3f}",
            markup=False,
        )
    if found["cut_ticks"]:
        console.print(f"{found['cut_ticks']} plans were cut short by the clock", markup=False)
    console.print(health_words(found), markup=False)
    if sentence := offer_words(found):
        console.print(sentence, markup=False)
    console.print(f"log: {found['log']}", markup=False, soft_wrap=True)
