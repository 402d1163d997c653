"""Every fault on every kind of drive in lockstep: the drive gets to its safe state in time, stays there, and nothing
unsafe happens.
"""

import math

import can
import numpy as np
import pytest

from hil.app.sil.fault_outcomes import limit_of, limit_s, outcomes
from hil.app.sil.testbed import Bench
from hil.bus.protection import Receiver
from hil.nodes.frame_map import frame_map_of, frames
from hil.nodes.node import FAULTY, OTHER_CONTROLLER
from hil.simulated.faults import KINDS, Fault, read_faults
from hil.simulated.injection import FaultInjection
from hil.simulated.medium import Medium, SimulatedBus
from tests.hil.app.sil.sil_runs import RIGS, model_of, run, scenario_of
from tests.hil.simulated.fault_rows import OWN_KINDS

AT_S, DURATION_S = 0.3, 0.2
REFUSED = ("duplicate", "reorder", "replay")
EVERYTHING = [
    (kind, f, target) for kind in RIGS for f in OWN_KINDS for target in (("all",) if f in REFUSED else KINDS[f].targets)
]


@pytest.mark.parametrize(("rig", "fault", "target"), EVERYTHING)
def test_matrix(rig: str, fault: str, target: str) -> None:
    trace, found = run(
        rig, AT_S + DURATION_S + 0.05, {"kind": fault, "at_s": AT_S, "duration_s": DURATION_S, "target": target}
    )
    t, safe, _ = trace.slots.T
    assert not found[0].unsafe
    assert not safe[np.argmin(abs(t - AT_S))], "the drive must have moved before"
    allowed_s = limit_of(scenario_of(rig, 1.0, {"kind": fault, "at_s": AT_S, "target": target}), found[0].fault)
    if math.isinf(allowed_s):
        assert math.isnan(found[0].safe_after_s) or target == "same"
        assert trace.stopped_because == ""
        return
    assert found[0].safe_after_s <= allowed_s
    first = np.argmax(t - AT_S >= found[0].safe_after_s - 1e-9)
    assert safe[first:].all(), "a drive must not begin again by itself"
    if fault in ("drop", "delay", "corrupt", "retyped", "killed", "frozen") and target in ("", "commands", "all"):
        assert found[0].since_good_s <= frame_map_of(rig).stops_s


def test_limits_are_those_that_are_asked() -> None:
    """Carriage, coil and inner mass in ms; a weaker fault than the kind's own may be ridden through."""
    asked = {
        ("drop", "commands"): (20, 10, 10),
        ("delay", "feedback"): (25, 10, 10),
        ("killed", ""): (20, 10, 10),
        ("babbling", ""): (20, 20, 20),
        ("bus_off", "drive"): (20, 20, 20),
        ("stuck", "localisation"): (50, 50, 50),
        ("lost", "localisation"): (155, 155, 155),
        ("bus_off", "localiser"): (155, 155, 155),
        ("over_temperature", ""): (500, 500, 500),
        ("late_solve", ""): (20, 20, 20),
    }
    for (kind, target), limits in asked.items():
        assert tuple(round(1e3 * limit_s(rig, Fault(kind, 0.3, target=target))) for rig in RIGS) == limits
    assert math.isinf(limit_s("coil", Fault("drop", 0.3, value=0.5)))
    assert math.isinf(limit_s("coil", Fault("replay", 0.3)))


def test_a_drive_that_is_late_or_moves_again_is_unsafe() -> None:
    """As with a drive that does not heed its commands' life, and one that enables itself."""
    trace, found = run("coil", 0.6, {"kind": "killed", "at_s": AT_S})
    assert not found[0].unsafe
    scenario, (t, safe, _) = scenario_of("coil", 0.6, {"kind": "killed", "at_s": AT_S}), trace.slots.T
    good = trace.slots.copy()
    safe[(t > AT_S) & (t < AT_S + 0.012)] = 0
    assert outcomes(scenario, trace)[0].unsafe
    safe[t > AT_S] = 0
    assert outcomes(scenario, trace)[0].unsafe
    trace.slots[:] = good
    safe[-3:] = 0
    assert outcomes(scenario, trace)[0].unsafe


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


def test_faults_that_come_together_are_credited_as_a_set() -> None:
    """Whatever the order in the file: the reaction counts from the first, and the set must be safe as soon as each."""
    together = [{"kind": "stuck", "at_s": 0.301}, {"kind": "killed", "at_s": 0.3}, {"kind": "drop", "at_s": 0.3}]
    _, found = run("magnetic", 0.6, *together, {"kind": "duplicate", "at_s": 0.5})
    first, second = (outcome.document() for outcome in found)
    assert (first["fault"], first["at_s"], first["unsafe"]) == (
        "killed + drop commands + stuck localisation",
        0.3,
        False,
    )
    assert 0 < first["safe_after_ms"] <= 20
    assert second["fault"] == "duplicate commands"


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("part", range(8))
def test_a_controller_off_the_bus_in_the_middle_of_a_tick(rig: str, part: int) -> None:
    """A frame of its on the wire breaks off; it used to bring the node back to the bus as it ended."""
    trace, found = run(rig, 0.35, {"kind": "bus_off", "at_s": 0.2 + 2.5e-4 * part, "target": "controller"})
    assert not found[0].unsafe
    assert 0 < found[0].safe_after_s <= 0.02
    assert trace.stopped_because == "feedback lost"


@pytest.mark.parametrize("kind", ["second_master", "player"])
def test_another_controller_is_stopped_for_within_a_tick(kind: str) -> None:
    """The true one says SafeStop to all in the tick in which it hears the other, and stays stopped."""
    scenario = scenario_of("magnetic", 0.6, {"kind": kind, "at_s": AT_S, "duration_s": 0.1})
    bench = Bench(scenario, model_of("magnetic"), "feedforward", 1)
    ear = SimulatedBus(bench.medium, "ear")
    bench.start()
    stop = frames()["SafeStop"]
    at = []
    for _ in range(round(0.6 / bench.tick_s)):
        bench.begin_tick()
        for number in range(bench.slots):
            bench.slot(number)
        bench.end_tick()
        while (message := ear.recv(0)) is not None:
            at += [message] if message.arbitration_id == stop.id else []
    own = [m for m in at if m.channel == "controller"]
    assert own[0].timestamp - AT_S < 2 * bench.tick_s
    assert Receiver(stop).accept(own[0].data, 0.0) == {"Target": 0, "Reason": OTHER_CONTROLLER}
    assert (bench.node.state, bench.plant.drive.safe) == (FAULTY, True)
    assert "another controller is on the bus" in bench.node.reason


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"kind": "dorp", "at_s": 1.0}, "got 'dorp'; did you mean 'drop'"),
        (
            {"kind": "drop", "at_s": 1.0, "target": "coil"},
            "one of commands, feedback, localisation, all, setpoints; got 'coil'",
        ),
        ({"kind": "killed", "at_s": 1.0, "target": "drive"}, "must be left out; got 'drive'"),
        ({"kind": "drop", "at_s": -1.0}, "at_s must be zero or more"),
        ({"kind": "drop", "at_s": 9.0}, "within the run of 2 s; got 9"),
        ({"kind": "drop", "at_s": 1.0, "duration_s": 0.0}, "duration_s must be positive"),
        ({"kind": "stuck", "at_s": 1.0, "value": 1.0}, "must be left out; got 1"),
        ({"kind": "delay", "at_s": 1.0, "value": -1.0}, "must lie in [0.0001, 10] (s); got -1"),
        (
            {"kind": "drop", "at_s": 1.0, "value": 5.0},
            "value of drop must lie in [1e-06, 1] (share of the frames); got 5",
        ),
        ({"kind": "corrupt", "at_s": 1.0, "value": 0.0}, "value of corrupt must lie in"),
        (
            {"kind": "replay", "at_s": 1.0, "value": 1000.0},
            "value of replay must lie in [1, 32] (frames ago); got 1000",
        ),
        ({"kind": "replay", "at_s": 1.0, "value": 0.5}, "value of replay must lie in"),
        ({"kind": "replay", "at_s": 1.0, "value": 1.5}, "must be a whole number of frames; got 1.5"),
        ({"kind": "over_temperature", "at_s": 1.0, "value": -1e9}, "must lie in [-40, 150] (degC); got -1e+09"),
        ({"kind": "clock_jump", "at_s": 1.0, "value": 1e9}, "must lie in [-1000, 1000] (s)"),
        ({"kind": "biased", "at_s": 1.0, "value": 2.0}, "must lie in [-1, 1] (m or A)"),
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
    """Identifier and first byte of what gets through a link with a fault of `kind` on 256, frames 0, 1, 2, ... 1 ms
    apart.
    """
    medium = Medium()
    sender, port = SimulatedBus(medium, "sender"), SimulatedBus(medium, "receiver")
    link = FaultInjection(port, lambda: medium.now_s)
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
