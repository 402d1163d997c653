"""Frames whose authenticator, freshness or type is wrong are as if they had not been said: the drive's own time to live
ends in the safe state. And what the judge says where a check is gone.
"""

import hmac
import math

import can
import pytest

from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.sil.fault_outcomes import FaultOutcome, limit_of
from hil.app.sil.loop import SilTrace, run_sil
from hil.bus.authenticated import AuthenticatedBus, inside
from hil.bus.protection import Receiver
from hil.nodes.frame_map import frames
from tests.hil.app.sil.sil_runs import RIGS, keyed, model_of, run, scenario_of

AT_S = 0.3
REASONS = {
    "forged": "forged",
    "wrong_key": "forged",
    "recorded": "replayed",
    "unkeyed": "classic",
    "epoch_back": "replayed",
}
WAYS = ("commands", "feedback", "localisation")


def spoiled(kind: str, target: str) -> tuple[SilTrace, FaultOutcome]:
    """A run over an authenticated bus on which something goes wrong."""
    trace, found = run("magnetic", AT_S + 0.25, {"kind": kind, "at_s": AT_S, "target": target})
    return trace, found[0]


@pytest.mark.parametrize("target", WAYS)
@pytest.mark.parametrize("kind", REASONS)
def test_not_acted_on_and_counted(kind: str, target: str) -> None:
    trace, outcome = spoiled(kind, target)
    assert set(trace.unauthenticated) == {REASONS[kind]}
    assert trace.unauthenticated[REASONS[kind]] >= 20
    assert not outcome.unsafe
    assert 0 < outcome.safe_after_s <= limit_of(scenario_of("magnetic", 1.0), outcome.fault)
    assert trace.stopped_because == {"commands": "drive fault 4 (time to live)"}.get(target, f"{target} lost")


@pytest.mark.parametrize(
    ("kind", "where", "instead"),
    [
        ("forged", (hmac, "compare_digest"), lambda *_: True),
        ("wrong_key", (hmac, "compare_digest"), lambda *_: True),
        ("recorded", (AuthenticatedBus, "_fresh"), lambda *_: True),
        ("epoch_back", (AuthenticatedBus, "_fresh"), lambda *_: True),
        ("unkeyed", (AuthenticatedBus, "_opened"), lambda _, wire: inside(wire)),
    ],
)
@pytest.mark.parametrize("target", WAYS[:2])
def test_without_the_check_it_would_be_unsafe(
    kind: str, where: tuple[object, str], instead: object, target: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(*where, instead)
    assert spoiled(kind, target)[1].unsafe


def test_leads_as_on_a_classic_bus() -> None:
    classic, _ = run("magnetic", 0.6)
    trace, _ = run("magnetic", 0.6, bus=keyed())
    assert trace.rows[-1, 1] == pytest.approx(classic.rows[-1, 1], abs=2e-4)
    assert (trace.stopped_because, trace.unauthenticated) == ("", {})
    assert 0.5 * classic.frames < trace.frames <= 1.01 * classic.frames
    assert trace.load < classic.load, "data at 5 Mbit/s"


@pytest.mark.parametrize(("kind", "reason"), [("player", "replayed"), ("second_master", "classic")])
def test_strangers_without_the_key_are_not_heard(kind: str, reason: str) -> None:
    """On a classic bus each of them stops the controller."""
    trace, (outcome,) = run("magnetic", 0.6, {"kind": kind, "at_s": AT_S}, bus=keyed())
    assert (math.isnan(outcome.safe_after_s), outcome.unsafe, trace.stopped_because) == (True, False, "")
    assert trace.unauthenticated[reason] > 100
    _, (classic,) = run("magnetic", 0.6, {"kind": kind, "at_s": AT_S})
    assert classic.safe_after_s < 0.02


@pytest.mark.parametrize("target", ["controller", "drive"])
def test_a_node_that_leaves_the_bus_stops(target: str) -> None:
    """The drive sees its own bus-off through the authenticated bus."""
    _, (outcome,) = run("magnetic", 0.6, {"kind": "bus_off", "at_s": AT_S, "target": target}, bus=keyed())
    assert not outcome.unsafe
    assert outcome.safe_after_s <= (0.005 if target == "drive" else 0.02)


def test_operators_frames_are_authenticated_too() -> None:
    fault = {"kind": "miscounted", "at_s": AT_S}
    trace, (outcome,) = run("magnetic", 0.6, fault, bus=keyed())
    assert not outcome.unsafe
    assert trace.unauthenticated["forged"] == 10
    assert outcome.safe_after_s < 0.115


def test_a_fault_of_the_authenticator_needs_a_key() -> None:
    raw = {"scenario": {"name": "a", "duration_s": 1.0}, **RIGS["magnetic"]}
    with pytest.raises(ValueError, match=r"faults\.kind forged commands must stand with bus\.key_file"):
        parse_sil_scenario({**raw, "faults": [{"kind": "forged", "at_s": 0.3}]})


def test_who_looks_on_sees_the_catalogues_frames() -> None:
    """As `capsule sil --watch` shows them."""
    seen: list[can.Message] = []
    scenario = scenario_of("magnetic", 0.3, bus=keyed())
    run_sil(scenario, model_of("magnetic"), "feedforward", 1, shown=seen.append)
    assert len(seen) > 100
    assert {(len(message.data), message.is_fd) for message in seen} == {(8, False)}
    sync = frames()["Sync"]
    receiver = Receiver(sync)
    assert all(isinstance(receiver.accept(m.data, m.timestamp), dict) for m in seen if m.arbitration_id == sync.id)
