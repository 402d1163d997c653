"""What a page may command: nothing before it has armed, nothing once it is silent, one page at a time."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from hil.app.cockpit.operator_panel import HOLD_S, PARTING_S, SAFE_S, OperatorPanel
from hil.app.cockpit.panels import Facts
from hil.app.cockpit.source import BusSource
from hil.app.run.clock import Clock
from hil.bus.protection import Receiver, Sender
from hil.nodes.frame_map import FRAME_MAPS
from hil.nodes.operator import OperatorLimits
from tests.hil.app.cockpit.story import CATALOGUE
from tests.hil.scripted_bus import ScriptedBus

FACTS = Facts("test", "", FRAME_MAPS["magnetic"], CATALOGUE)
SETPOINT, SAFE_STOP = CATALOGUE["OperatorSetpoint"], CATALOGUE["SafeStop"]
SPEED = {"ask": "hold", "mode": "speed", "value": 0.002}
ARM = {"ask": "arm", "on": True}


@dataclass
class Bench:
    """OperatorPanel on a bus that keeps what is sent, and a clock that is set."""

    limits: OperatorLimits | None = field(default_factory=lambda: OperatorLimits(accept=True))
    now: float = 0.0

    def __post_init__(self) -> None:
        self.bus = ScriptedBus()
        self.operator = OperatorPanel(
            BusSource(self.bus, Clock(), FACTS), Path("x.toml"), self.limits, lambda: self.now
        )

    def hears(self, state: str) -> None:
        """A controller that takes setpoints, and a carriage in this state, as the bus has just told."""
        feedback = {"Position_m": 0.0, "Velocity_m_s": 0.0, "Temperature_degC": 25.0}
        status = {"State": 3, "Source": 0, "Refused": 0, "Position_m": 0.0, "Velocity_m_s": 0.0}
        number = CATALOGUE["CarriageFeedback"].field("State").number(state)
        beat = {"State": 2, "Uptime_s": 1.0, "Catalogue": CATALOGUE.fingerprint}
        said = {"CarriageFeedback": feedback | {"State": number}, "ControllerHeartbeat": beat, "OperatorStatus": status}
        for name, values in said.items():
            self.operator.source.watch.take(0.0, CATALOGUE[name].id, Sender(CATALOGUE[name]).frame(values))

    def told(self, seconds: float) -> list[dict[str, float]]:
        """The setpoints of so many seconds."""
        self.bus.sent.clear()
        for _ in range(round(seconds / 0.02)):
            self.operator.cycle()
            self.now += 0.02
        found: list[dict[str, float]] = []
        receiver = Receiver(SETPOINT)
        for k, message in enumerate(m for m in self.bus.sent if m.arbitration_id == SETPOINT.id):
            values = receiver.accept(message.data, 0.02 * k)
            assert isinstance(values, dict)
            found.append(values)
        return found


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_nothing_is_sent_before_a_page_has_armed(bench: Bench) -> None:
    assert bench.told(0.5) == []
    with pytest.raises(ValueError, match="speed"):
        bench.operator.asked("page", SPEED)
    assert bench.told(0.5) == []


def test_a_held_button_steers_and_silence_lets_go(bench: Bench) -> None:
    assert bench.operator.asked("page", ARM) == ""
    assert {one["DeadMan"] for one in bench.told(0.2)} == {0.0}
    bench.operator.asked("page", SPEED)
    held = [one["DeadMan"] for one in bench.told(0.4)]
    assert held.count(1.0) == pytest.approx(HOLD_S / 0.02, abs=1.01)
    assert held[-1] == 0.0
    bench.operator.asked("page", SPEED)
    first = bench.told(0.02)[0]
    assert first["Velocity_m_s"] == pytest.approx(0.002)
    assert first["TimeToLive_ms"] == 100
    bench.operator.asked("page", {"ask": "let_go"})
    assert bench.told(0.02)[0]["DeadMan"] == 0.0


def test_a_position_is_held_as_well(bench: Bench) -> None:
    bench.operator.asked("page", ARM)
    bench.operator.asked("page", {"ask": "hold", "mode": "position", "value": 0.01})
    told = bench.told(0.02)[0]
    assert (told["Mode"], told["DeadMan"]) == (0.0, 1.0)
    assert told["Position_m"] == pytest.approx(0.01)


def test_a_page_that_is_gone_lets_go_and_then_nothing_is_sent(bench: Bench) -> None:
    bench.operator.asked("page", ARM)
    bench.operator.asked("page", SPEED)
    bench.told(0.04)
    bench.operator.left("page")
    told = bench.told(1.0)
    assert {one["DeadMan"] for one in told} == {0.0}
    assert len(told) == pytest.approx(PARTING_S / 0.02, abs=1.01)


def test_one_page_at_a_time(bench: Bench) -> None:
    for page in ("one", "other"):
        bench.operator.asked(page, ARM)
    bench.operator.asked("one", SPEED)
    assert bench.operator.asked("other", SPEED) == "another page steers: release, wait until it has let go, press again"
    bench.told(0.3)
    assert bench.operator.asked("other", SPEED) == ""


def test_a_safe_stop_goes_to_all_and_lets_go(bench: Bench) -> None:
    bench.operator.asked("page", ARM)
    bench.operator.asked("page", SPEED)
    bench.operator.asked("page", {"ask": "safe_stop"})
    assert {one["DeadMan"] for one in bench.told(0.1)} == {0.0}
    stops = [m for m in bench.bus.sent if m.arbitration_id == SAFE_STOP.id]
    assert len(stops) == 5
    assert Receiver(SAFE_STOP).accept(stops[0].data, 0.0) == {"Target": 0.0, "Reason": 0.0}
    bench.told(2 * SAFE_S)
    bench.told(0.1)
    assert not [m for m in bench.bus.sent if m.arbitration_id == SAFE_STOP.id]


@pytest.mark.parametrize("state", ["standby", "fault", "boot"])
def test_a_controlled_stop_where_nothing_moves_sends_nothing_and_says_so(bench: Bench, state: str) -> None:
    bench.hears(state)
    assert bench.operator.asked("page", {"ask": "stop"}) == f"nothing moves: carriage is in {state}"
    assert bench.told(1.0) == []
    assert not any("controlled stop" in event.words for event in bench.operator.source.watch.events)


@pytest.mark.parametrize("state", ["ready", "enabled", "derated"])
def test_a_controlled_stop_of_another_ones_run_is_a_press_at_speed_0(bench: Bench, state: str) -> None:
    """Also where the page that asked for it is gone at once."""
    bench.hears(state)
    assert bench.operator.asked("page", {"ask": "stop"}) == ""
    bench.operator.left("page")
    told = bench.told(1.0)
    held = [one for one in told if one["DeadMan"]]
    assert len(held) >= 7
    assert {(one["Mode"], one["Velocity_m_s"]) for one in held} == {(1.0, 0.0)}
    assert not told[0]["DeadMan"]
    assert not told[-1]["DeadMan"]
    assert "the run goes on" in bench.operator.source.watch.events[-1].words


def test_a_safe_stop_goes_out_always_and_says_where_nothing_moves(bench: Bench) -> None:
    bench.hears("standby")
    assert bench.operator.asked("page", {"ask": "safe_stop"}) == ""
    bench.told(0.1)
    assert [m for m in bench.bus.sent if m.arbitration_id == SAFE_STOP.id]
    words = "safe stop sent to all drives by this cockpit; nothing moves: carriage is in standby"
    assert bench.operator.source.watch.events[-1].words == words


@pytest.mark.parametrize("stop", ["stop", "safe_stop"])
def test_a_button_that_is_held_through_a_stop_is_none_until_it_is_let_go(bench: Bench, stop: str) -> None:
    bench.hears("enabled")
    bench.operator.asked("page", ARM)
    bench.operator.asked("page", SPEED)
    bench.operator.asked("another page", {"ask": stop})
    for _ in range(50):
        assert bench.operator.asked("page", SPEED).startswith("the button was held through a stop")
        assert not any(one["DeadMan"] and one["Velocity_m_s"] for one in bench.told(0.04))
    bench.operator.asked("page", {"ask": "let_go"})
    assert bench.operator.asked("page", SPEED) == ""
    assert bench.told(0.02)[0]["DeadMan"]


def test_a_button_that_is_held_while_another_page_steers_is_none_until_it_is_let_go(bench: Bench) -> None:
    for page in ("one", "other"):
        bench.operator.asked(page, ARM)
    bench.operator.asked("one", SPEED)
    assert bench.operator.asked("other", SPEED) == "another page steers: release, wait until it has let go, press again"
    bench.operator.asked("one", {"ask": "let_go"})
    for _ in range(20):
        assert bench.operator.asked("other", SPEED) != ""
        assert not any(one["DeadMan"] for one in bench.told(0.04))
    bench.told(0.2)
    assert bench.operator.asked("other", SPEED) == "", "silent for longer than a hold lives: let go"


def test_a_page_that_goes_and_comes_again_presses_nothing(bench: Bench) -> None:
    """Reloaded, its socket lost, its browser gone while the button is held."""
    bench.operator.asked("page", ARM)
    bench.operator.asked("page", SPEED)
    bench.told(0.04)
    bench.operator.left("page")
    bench.operator.asked("page again", ARM)
    assert {one["DeadMan"] for one in bench.told(1.0)} == {0.0}


def test_what_cannot_be_is_a_sentence() -> None:
    closed = Bench(None)
    assert "set [operator] accept = true in the deployment file" in closed.operator.asked("page", ARM)
    assert "no controller runs" in closed.operator.asked("page", {"ask": "stop"})
    closed.hears("enabled")
    assert "takes no setpoints: press Ctrl-C in its terminal" in closed.operator.asked("page", {"ask": "stop"})
    other = Bench(OperatorLimits(accept=True, sources=("joystick",)))
    assert "steering is left to joystick: add cockpit to [operator] sources" in other.operator.asked("page", ARM)


@pytest.mark.parametrize(
    "asked", [{}, {"ask": "dance"}, {"ask": "hold", "mode": "speed", "value": float("nan")}, {"ask": "arm"}]
)
def test_nonsense_is_nothing(bench: Bench, asked: dict[str, Any]) -> None:
    bench.operator.asked("page", ARM)
    with pytest.raises((ValueError, KeyError)):
        bench.operator.asked("page", asked)


def test_a_run_that_cannot_begin_is_told(bench: Bench) -> None:
    bench.operator.asked("page", {"ask": "start"})
    assert bench.operator.document("page")["run"]
    assert bench.operator.asked("page", {"ask": "start"}).startswith("a run that was started here goes on")
    assert bench.operator._run is not None
    bench.operator._run.wait(60)
    bench.operator.cycle()
    assert not bench.operator.document("page")["run"]
    assert "x.toml" in bench.operator.source.watch.events[-1].words
    bench.operator.close()
