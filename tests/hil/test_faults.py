"""Every fault on every kind of drive in lockstep: the drive gets to its safe state in time, stays there, and nothing unsafe happens."""

import math

import can
import numpy as np
import pytest

from hil.bus.sim import Medium, SimulatedBus
from hil.nodes.fault import KINDS, Fault, read_faults
from hil.nodes.link import Link
from tests.hil.sil_runs import RIGS, run

AT_S, DURATION_S = 0.3, 0.2
TO_LIVE_S = {"magnetic": 0.020, "coil": 0.010, "vibro": 0.010}
"""From the last good command frame to the safe state."""
BUS_S = dict.fromkeys(RIGS, 0.02)
SEEN_S = {"magnetic": 0.025, "coil": 0.010, "vibro": 0.010}
"""A carriage that is not heard for 20 ms is stopped, another drive after 10."""
PLACE_S = dict.fromkeys(RIGS, 0.155)
"""150 ms without localisation, and the next tick's way to the drive."""
BLIND = ("bus_off localiser", "nan localisation", "lost localisation", "drop localisation", "corrupt localisation")
REFUSED = ("duplicate", "reorder", "replay")
EVERYTHING = [
    (kind, f, target) for kind in RIGS for f, known in KINDS.items() for target in (("all",) if f in REFUSED else known.targets)
]
HARMLESS = {*((f, "all") for f in REFUSED), ("delay", "localisation")}
"""What the loop rides through: doubled and old frames are refused, of frames that changed places each second one is taken."""
UNSEEN = {("coil", "biased"), ("vibro", "stuck"), ("vibro", "biased")}
"""A report that nothing acts on, by less than what counts as not following."""


def allowed_s(rig: str, fault: str, target: str) -> float:
    """The longest time from the fault's begin to the safe state."""
    if fault in ("drop", "delay", "corrupt") and target in ("commands", "all"):
        return TO_LIVE_S[rig]
    if fault in ("killed", "frozen"):
        return TO_LIVE_S[rig]
    if fault in ("babbling",) or (fault == "bus_off" and target in ("controller", "drive")):
        return BUS_S[rig]
    if target == "feedback":
        return 0.05 if fault in ("stuck", "biased") else SEEN_S[rig]
    if fault == "stuck":
        return 0.05
    if f"{fault} {target}" in BLIND or fault == "biased":
        return PLACE_S[rig]
    return {"over_temperature": 0.5, "drive_reset": 0.02, "late_solve": 0.02, "clock_jump": 0.02}[fault]


@pytest.mark.parametrize(("rig", "fault", "target"), EVERYTHING)
def test_matrix(rig: str, fault: str, target: str) -> None:
    trace, found = run(rig, AT_S + DURATION_S + 0.05, {"kind": fault, "at_s": AT_S, "duration_s": DURATION_S, "target": target})
    t, safe, _ = trace.slots.T
    assert not found[0].unsafe
    assert not safe[np.argmin(abs(t - AT_S))], "the drive must have moved before"
    if (fault, target) in HARMLESS or ((rig, fault) in UNSEEN and target == "feedback"):
        assert math.isnan(found[0].safe_after_s)
        assert trace.stopped_because == ""
        return
    assert found[0].safe_after_s <= allowed_s(rig, fault, target)
    first = np.argmax(t - AT_S >= found[0].safe_after_s - 1e-9)
    assert safe[first:].all(), "a drive must not begin again by itself"
    if fault in ("drop", "delay", "corrupt", "killed", "frozen") and target in ("", "commands", "all"):
        assert found[0].since_good_s <= TO_LIVE_S[rig]


@pytest.mark.parametrize("rig", RIGS)
def test_warm_drive_is_derated_and_goes_on(rig: str) -> None:
    trace, found = run(rig, 0.6, {"kind": "over_temperature", "at_s": 0.3, "value": 42.0})
    assert math.isnan(found[0].safe_after_s)
    assert trace.stopped_because == ""


def test_each_fault_is_told_on_its_own() -> None:
    faults = [{"kind": "duplicate", "at_s": 0.2, "duration_s": 0.05}, {"kind": "killed", "at_s": 0.3}]
    _, found = run("magnetic", 0.5, *faults)
    first, second = (outcome.document() for outcome in found)
    assert first == {"fault": "duplicate commands", "at_s": 0.2, "safe_after_ms": None, "unsafe": False}
    assert (second["fault"], second["at_s"]) == ("killed", 0.3)
    assert 0 < second["safe_after_ms"] < 25


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "dorp", "at_s": 1.0}, "got 'dorp'; did you mean 'drop'"),
        ({"kind": "drop", "at_s": 1.0, "target": "coil"}, "one of commands, feedback, localisation, all; got 'coil'"),
        ({"kind": "killed", "at_s": 1.0, "target": "drive"}, "must be left out; got 'drive'"),
        ({"kind": "drop", "at_s": -1.0}, "at_s must be zero or more"),
        ({"kind": "drop", "at_s": 9.0}, "within the run of 2 s; got 9"),
        ({"kind": "drop", "at_s": 1.0, "duration_s": 0.0}, "duration_s must be positive"),
        ({"kind": "stuck", "at_s": 1.0, "value": 1.0}, "must be left out; got 1"),
        ({"kind": "delay", "at_s": 1.0, "value": -1.0}, "must be positive; got -1"),
        ({"kind": "drop", "at": 1.0}, "'at'"),
        ({"kind": "drop"}, "must have at_s"),
    ],
)
def test_bad_tables_are_refused_in_a_sentence(table: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match="faults") as error:
        read_faults([table], 2.0)
    assert words in str(error.value)


def test_faults_must_be_tables() -> None:
    with pytest.raises(ValueError, match=r"\[\[faults\]\]"):
        read_faults({"kind": "drop"}, 2.0)


def heard(kind: str, ids: tuple[int, ...], **more: float) -> list[tuple[int, int]]:
    """Identifier and first byte of what gets through a link with a fault of `kind` on 256, frames 0, 1, 2, ... 1 ms apart."""
    medium = Medium()
    sender, port = SimulatedBus(medium, "sender"), SimulatedBus(medium, "receiver")
    link = Link(port, lambda: medium.now_s)
    link.faults = [(Fault(kind, 0.0, **more), frozenset({256}))]
    got = []
    for k in range(20):
        if k < len(ids):
            sender.send(can.Message(arbitration_id=ids[k], is_extended_id=False, data=bytes([k] * 8)))
        medium.advance((k + 1) * 1e-3)
        while (message := link.recv(0)) is not None:
            got.append((message.arbitration_id, message.data[0]))
            assert message.timestamp <= medium.now_s
    return got


def test_link_faults_do_what_they_say() -> None:
    ids = (256, 256, 384, 256)
    assert heard("drop", ids) == [(384, 2)]
    assert heard("duplicate", ids) == [(256, 0), (256, 0), (256, 1), (256, 1), (384, 2), (256, 3), (256, 3)]
    assert heard("reorder", (*ids, 256)) == [(256, 1), (256, 0), (384, 2), (256, 4), (256, 3)]
    assert heard("delay", ids, value=2.5e-3) == [(256, 0), (384, 2), (256, 1), (256, 3)]
    assert heard("replay", ids, value=2) == [(256, 0), (256, 1), (384, 2), (256, 3), (256, 0)]
    corrupt = heard("corrupt", ids)
    assert len(corrupt) == 4
    assert (384, 2) in corrupt
