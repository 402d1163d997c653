"""What each lie does to the frames and to the plant: valid in form, false in content; and how its run is judged."""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest

from controller.drives import envelope_of
from hil.app.sil.fault_outcomes import FaultOutcome, outcomes
from hil.app.sil.loop import SilTrace, run_sil
from hil.bus.local import LocalBus
from hil.bus.protection import Receiver
from hil.nodes.frame_map import MOVING, STANDBY, WAITING, frame_map_of, frames
from hil.simulated.faults import LIES, Fault, read_faults, read_lie
from plant import layout as at
from tests.hil.app.run.deployments import PLANT, deployment
from tests.hil.app.run.forked import Forked
from tests.hil.app.sil.sil_runs import model_of, scenario_of

AT_S = 0.4


class Heard:
    """A run, and the values of two frames on its wire with the times at which they came."""

    def __init__(self, rig: str, *faults: Mapping[str, Any], seconds: float = 1.4, **tables: Any) -> None:
        scenario = scenario_of(rig, seconds, *faults, **tables)
        wire: list[can.Message] = []
        controller = scenario.loop.control.controller
        self.trace: SilTrace = run_sil(scenario, model_of(rig), controller, 1, shown=wire.append)
        self.outcomes: list[FaultOutcome] = outcomes(scenario, self.trace)
        self.report = frame_map_of(rig).feedback
        self._receivers = {
            frames()[name].id: Receiver(frames()[name])
            for name in ("CapsuleLocalisation", frame_map_of(rig).feedback, frame_map_of(rig).command)
        }
        self.values: dict[str, list[dict[str, float]]] = {}
        for message in wire:
            if (receiver := self._receivers.get(message.arbitration_id)) is None:
                continue
            values = receiver.accept(message.data, message.timestamp)
            assert isinstance(values, dict), "frames that lie are valid in form"
            self.values.setdefault(receiver.frame.name, []).append({**values, "t": message.timestamp})

    def column(self, frame: str, signal: str, since_s: float = AT_S + 0.05) -> tuple[np.ndarray, np.ndarray]:
        """Times and values of a signal."""
        rows = [v for v in self.values[frame] if v["t"] >= since_s and v.get("Valid", 1)]
        return np.array([v["t"] for v in rows]), np.array([v[signal] for v in rows])

    def led(
        self, signal: str, states: tuple[int, ...] = MOVING, since_s: float = AT_S + 0.004
    ) -> tuple[np.ndarray, np.ndarray]:
        """Times and values of a signal of the drive's report while it is in one of these states."""
        rows = [v for v in self.values[self.report] if v["t"] >= since_s and v["State"] in states]
        return np.array([v["t"] for v in rows]), np.array([v[signal] for v in rows])

    def true(self, t: np.ndarray, column: int = at.O_X) -> np.ndarray:
        """What was true at these times."""
        return np.interp(t, self.trace.rows[:, at.O_T], self.trace.rows[:, column])

    def told(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """When each place was true by its age, what was told and what was true then, from the lie on."""
        t, place = self.column("CapsuleLocalisation", "Position_m")
        age = self.column("CapsuleLocalisation", "Age_s")[1]
        return t - age, place, self.true(t - age)


def lie(kind: str, **more: Any) -> dict[str, Any]:
    """One, of a localiser unless said otherwise, without noise of the sensor's own."""
    return {"kind": kind, "at_s": AT_S, **more}


QUIET = {"localisation": {"std": 1e-5}}


@pytest.mark.parametrize("value", [0.005, -0.02])
def test_drift_grows_and_ends(value: float) -> None:
    t, told, true = Heard("magnetic", lie("drift", value=value), **QUIET).told()
    assert told - true == pytest.approx(value * (t - AT_S), abs=1e-4)
    _, told, true = Heard("magnetic", lie("drift", value=value, size_m=2e-3), **QUIET).told()
    assert (told - true)[-1] == pytest.approx(math.copysign(2e-3, value), abs=1e-4)


def test_what_each_lie_of_a_localiser_tells() -> None:
    at_begin = float(np.interp(AT_S, *Heard("magnetic", **QUIET).trace.rows[:, [at.O_T, at.O_X]].T))
    wanted = {
        "flipped": lambda t, x: -x,
        "turned": lambda t, x: 2 * at_begin - x,
        "scaled": lambda t, x: at_begin + 2 * (x - at_begin),
        "jumped": lambda t, x: x + 4e-3,
        "sway": lambda t, x: x + 0.01 * np.sin(2 * np.pi * (t - AT_S) / 8),
        "held": lambda t, x: at_begin + 0 * x,
        "coarse": lambda t, x: 2e-3 * np.round(x / 2e-3),
    }
    for kind, made in wanted.items():
        t, told, true = Heard("magnetic", lie(kind), **QUIET).told()
        allowed = 1.1e-3 if kind == "coarse" else 2e-4
        assert told == pytest.approx(made(t, true), abs=allowed), kind
        assert np.ptp(told) > 0 or kind == "coarse", "noise is left, so that it does not look stuck"


def test_a_lie_from_the_start_tells_where_it_began() -> None:
    for kind in ("flipped", "turned", "scaled", "held"):
        heard = Heard("magnetic", {"kind": kind, "at_s": 0.0}, seconds=0.4, **QUIET)
        assert abs(heard.column("CapsuleLocalisation", "Position_m", 0.0)[1][0]) < 1e-4


def test_late_is_told_truly_or_as_fresh() -> None:
    for kind, told_s in (("late", 0.06), ("late_unsaid", 0.008)):
        heard = Heard("magnetic", lie(kind, value=0.06), seconds=0.6, **QUIET)
        t, place = heard.column("CapsuleLocalisation", "Position_m", AT_S + 0.1)
        age = heard.column("CapsuleLocalisation", "Age_s", AT_S + 0.1)[1]
        assert age == pytest.approx(np.full(age.size, told_s), abs=2.1e-3)
        assert place == pytest.approx(heard.true(t - 0.06), abs=1e-4)


def test_noise_another_rig_and_another_place() -> None:
    _, told, true = Heard("magnetic", lie("noisy", value=20.0), **QUIET).told()
    assert np.std(told - true) == pytest.approx(2e-4, rel=0.3)
    t, told, true = Heard("magnetic", lie("foreign", value=0.02), **QUIET).told()
    assert np.max(np.abs(told - true)) > 1e-3
    assert np.max(np.abs(np.diff(told))) < 5e-4, "smooth"
    heard = Heard("magnetic", lie("swapped"), **QUIET)
    t, told, _ = heard.told()
    assert np.median(np.abs(told - heard.true(t, at.O_DRIVE))) < 2e-4
    assert np.median(np.abs(told - heard.true(t))) > 5e-4


@pytest.mark.parametrize(("kind", "times"), [("turned", -1.0), ("scaled", 2.0), ("held", 0.0)])
def test_carriage_goes_otherwise_while_its_report_follows(kind: str, times: float) -> None:
    heard = Heard("magnetic", lie(kind, target="drive"), seconds=0.8, **QUIET)
    t, reported = heard.led("Position_m")
    commanded = np.interp(t, *heard.column("CarriageCommand", "Position_m", 0.2))
    assert np.median(np.abs(reported - commanded)) < 2e-4, "the report follows the command"
    assert np.ptp(reported) > 1e-4
    assert np.polyfit(reported, heard.true(t, at.O_DRIVE), 1)[0] == pytest.approx(times, abs=0.1)


@pytest.mark.parametrize(("kind", "times"), [("turned", -1.0), ("scaled", 2.0), ("held", 0.0)])
def test_coil_gets_another_current_than_it_reports(kind: str, times: float) -> None:
    value = {"value": 0.0} if kind == "held" else {}
    heard = Heard("coil", lie(kind, target="drive", **value), seconds=0.5, **QUIET)
    t, reported = heard.led("Current_A")
    assert np.ptp(reported) > 0.01
    assert np.polyfit(reported, heard.true(t - 1e-3, at.O_CURRENT), 1)[0] == pytest.approx(times, abs=0.2)


def test_inner_mass_is_on_whatever_it_is_told() -> None:
    heard = Heard("vibro", lie("held", target="drive", value=1.0), seconds=0.6)
    t, reported = heard.led("Current_A")
    assert reported.min() == 0.0
    assert heard.true(t, at.O_DRIVE).min() == pytest.approx(1.3)


def test_carriage_sticks_and_jumps() -> None:
    heard = Heard("magnetic", lie("sticks", target="drive", value=2e-3), seconds=2.0)
    t, reported = heard.led("Position_m")
    behind = np.abs(heard.true(t, at.O_DRIVE) - reported)
    assert 1.5e-3 < behind.max() < 3e-3


@pytest.mark.parametrize("rig", ["magnetic", "coil", "vibro"])
def test_a_drive_moves_by_itself_until_it_is_enabled_and_says_so(rig: str) -> None:
    value = {"magnetic": 0.02, "coil": 0.2, "vibro": 0.5}[rig]
    heard = Heard(rig, {"kind": "restless", "at_s": 0.0, "value": value}, seconds=0.12)
    signal = {"magnetic": "Position_m", "coil": "Current_A", "vibro": "Current_A"}[rig]
    t, reported = heard.led(signal, (STANDBY, WAITING), 0.0)
    expected = value * t if rig == "magnetic" else np.full(t.size, value)
    assert reported == pytest.approx(expected, abs=2e-3)
    column = {"magnetic": at.O_DRIVE, "coil": at.O_CURRENT, "vibro": at.O_DRIVE}[rig]
    true = heard.true(t, column) / (1.3 if rig == "vibro" else 1.0)
    assert true[1:] == pytest.approx(reported[1:], abs=2e-3)


@pytest.mark.parametrize(("kind", "times"), [("turned", -1.0), ("scaled", 2.0), ("held", 0.0)])
def test_report_is_false_while_the_drive_moves_right(kind: str, times: float) -> None:
    heard = Heard("magnetic", lie(kind, target="feedback"), seconds=0.42)
    t, reported = heard.led("Position_m")
    assert np.polyfit(heard.true(t, at.O_DRIVE), reported, 1)[0] == pytest.approx(times, abs=0.1)


def test_judged_by_the_true_place() -> None:
    """A magnet's capsule may be as far from the wanted place as the magnet lets it stay behind, and no farther."""
    near = Heard("magnetic", lie("drift", value=0.005), seconds=1.4, **QUIET).outcomes[0]
    assert not near.unsafe
    assert near.document()["distance_mm"] == pytest.approx(1e3 * near.distance_m)
    model = model_of("magnetic")
    gap_mm = 1e3 * envelope_of(model.drive, scenario_of("magnetic", 1.0).loop.limits).gap_m
    scenario = scenario_of("magnetic", 2.0, lie("drift", value=0.05), **QUIET)
    trace = run_sil(scenario, model, "feedforward", 1)
    trace.rows[trace.rows[:, at.O_T] > 0.5, at.O_X] -= 1e-3 * gap_mm + 5e-3
    found = outcomes(scenario, trace)[0]
    assert (found.unsafe, found.why) == (True, "too far")


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"kind": "drifts"}, r"faults\.kind must be one of .*drift.*got 'drifts'"),
        ({"kind": "drift", "target": "commands"}, r"faults\.target of drift must be one of localisation, feedback"),
        (
            {"kind": "drift", "value": 0.5},
            r"faults\.value of drift must lie in \[-0\.1, 0\.1\] \(m/s or A/s\); got 0\.5",
        ),
        ({"kind": "drift", "size_m": -1.0}, r"faults\.size_m of drift must be a positive number of m; got -1"),
        ({"kind": "sway", "size_m": 1.0}, r"faults\.size_m of sway must be left out; got 1"),
        ({"kind": "flipped", "value": 1.0}, r"faults\.value of flipped must be left out; got 1"),
        ({"kind": "late", "value": 2.0}, r"faults\.value of late must lie in \[0\.001, 0\.4\] \(s\); got 2"),
        ({"kind": "sticks", "target": "feedback"}, r"faults\.target of sticks must be one of drive; got 'feedback'"),
    ],
)
def test_bad_values_are_refused_in_a_sentence(table: Mapping[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        read_faults([{"at_s": 0.1, **table}], 1.0)


def test_a_lie_that_the_rig_cannot_tell_is_refused() -> None:
    with pytest.raises(ValueError, match=r"faults\.kind sticks drive must stand with rig\.kind magnetic; got 'coil'"):
        scenario_of("coil", 1.0, lie("sticks"))


def test_lies_last_to_the_end_unless_said_otherwise() -> None:
    assert all(Fault(kind, 0.1).end_s == math.inf for kind in LIES)
    assert Fault("drift", 0.1, 0.5).end_s == 0.6


def test_a_lie_as_it_is_typed() -> None:
    """`capsule plant --lie`."""
    assert read_lie("drift=-0.02@5") == Fault("drift", 5.0, math.inf, "localisation", -0.02)
    assert read_lie("turned:drive").name == "turned drive"
    for text, why in (("drifts", "the kind must be one of"), ("drift=x", "could not convert"), ("drop", "of a lie")):
        with pytest.raises(ValueError, match=rf"^--lie must be KIND.*got '{text}': .*{why}|of a lie; got '{text}'"):
            read_lie(text)


def test_a_plant_lies_on_a_live_bus(tmp_path: Path) -> None:
    """Whoever listens hears a localisation that is off, in frames that are valid."""
    (tmp_path / "plant.toml").write_text(PLANT)
    channel = f"lies-{os.getpid()}"
    deployed = tmp_path / "deployed.toml"
    deployed.write_text(deployment(channel, more='[plant]\nscenario = "plant.toml"\n'))
    bus, name = LocalBus(channel), "CapsuleLocalisation"
    child = Forked(tmp_path, "plant", str(deployed), "--seconds", "60", "--json", "--lie", "jumped=0.03@0.1")
    try:
        child.until_ready()
        receiver, told = Receiver(frames()[name]), 0.0
        for _ in range(3000):
            message = bus.recv(1.0)
            if message is not None and message.arbitration_id == frames()[name].id:
                values = receiver.accept(message.data, message.timestamp)
                told = max(told, values["Position_m"]) if isinstance(values, dict) else told
            if told > 0.02:
                break
    finally:
        child.kill()
        bus.shutdown()
    assert told == pytest.approx(0.03, abs=3e-3)
