"""The numbers in the code are those of the DBC."""

from hil.nodes.frame_map import (
    BOOT,
    BUS_OFF,
    DERATED,
    ENABLE,
    ENABLED,
    FAULT,
    HEARTBEAT_LOST,
    NO_FAULT,
    OFF,
    OVER_CURRENT,
    OVER_TEMPERATURE,
    QUICK_STOP,
    READY,
    SELF_TEST,
    STANDBY,
    STOPPING,
    TIME_TO_LIVE,
    WAITING,
    frame_map_of,
    frames,
)
from hil.nodes.node import FAULTY, HALTING, IDLE, RUNNING


def test_numbers_are_those_of_the_dbc() -> None:
    """Modes, states, codes and targets by their names there."""
    catalogue = frames()
    for kind in ("magnetic", "coil", "vibro"):
        frame_map = frame_map_of(kind)
        command, feedback, fault = (catalogue[n] for n in (frame_map.command, frame_map.feedback, frame_map.fault))
        modes = {"off": OFF, "ready": READY, "enable": ENABLE, "quick_stop": QUICK_STOP}
        assert {name: command.field("Mode").number(name) for name in modes} == modes
        states = {"boot": BOOT, "self_test": SELF_TEST, "standby": STANDBY, "ready": WAITING, "enabled": ENABLED}
        states |= {"derated": DERATED, "quick_stop": STOPPING, "fault": FAULT}
        assert {name: feedback.field("State").number(name) for name in states} == states
        codes = {
            "none": NO_FAULT,
            "over_current": OVER_CURRENT,
            "over_temperature": OVER_TEMPERATURE,
            "bus_off": BUS_OFF,
        }
        codes |= {"time_to_live": TIME_TO_LIVE, "heartbeat_lost": HEARTBEAT_LOST}
        assert {name: fault.field("Code").number(name) for name in codes} == codes
        node = {"Carriage": "carriage", "Coil": "coil", "InnerMass": "inner_mass"}[frame_map.node]
        assert catalogue["SafeStop"].field("Target").number(node) == frame_map.target
        assert command.field(frame_map.signal)
    beats = {"idle": IDLE, "running": RUNNING, "stopping": HALTING, "fault": FAULTY}
    assert {name: catalogue["ControllerHeartbeat"].field("State").number(name) for name in beats} == beats
