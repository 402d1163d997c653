"""CANSimple of firmware 0.6 in numbers and names: commands, states, results, errors. Source: the maker's CAN protocol
page, DBC and enumerations.
"""

import struct
from collections.abc import Mapping
from typing import Final

from hil.nodes.drive.state_machine import OVER_CURRENT, OVER_TEMPERATURE, TIME_TO_LIVE

# commands, of the maker's CAN protocol
GET_VERSION, HEARTBEAT, GET_ERROR, RX_SDO, TX_SDO, ADDRESS, SET_AXIS_STATE = 0x00, 0x01, 0x03, 0x04, 0x05, 0x06, 0x07
GET_ENCODER_ESTIMATES, SET_CONTROLLER_MODE, SET_INPUT_POS, SET_LIMITS = 0x09, 0x0B, 0x0C, 0x0F  # the same
CLEAR_ERRORS, SET_ABSOLUTE_POSITION = 0x18, 0x19
"""Commands: the 5 lower bits of an identifier, whose 6 upper ones are the node."""
TOLD: Final = (GET_VERSION, HEARTBEAT, GET_ERROR, TX_SDO, ADDRESS, GET_ENCODER_ESTIMATES, 0x14, 0x15, 0x17, 0x1C, 0x1D)
"""Those by which the drive speaks, asked or unasked."""
BROADCAST: Final = 63
"""The node by which every drive is spoken to, and at which one without an address stands."""
UNDEFINED, IDLE, CLOSED_LOOP = 0, 1, 8  # axis states
AXIS_STATES: Final[Mapping[int, str]] = {
    UNDEFINED: "undefined (it boots)",
    IDLE: "idle",
    2: "startup sequence",
    3: "full calibration sequence",
    4: "motor calibration",
    5: "sensorless control",
    6: "encoder index search",
    7: "encoder offset calibration",
    CLOSED_LOOP: "closed loop control, by somebody else",
    9: "lock-in spin",
    10: "encoder direction find",
    11: "homing",
    12: "encoder hall polarity calibration",
    13: "encoder hall phase calibration",
    14: "anticogging calibration",
}
"""Axis states in words; in all but the first two the motor has a current."""
SUCCESS, BUSY, DISARMED, INVALID_STATE, NOT_CALIBRATED = 0, 1, 3, 13, 14  # places in `RESULTS`
RESULTS: Final[tuple[str, ...]] = (
    "SUCCESS",
    "BUSY",
    "CANCELLED",
    "DISARMED",
    "NO_RESPONSE",
    "POLE_PAIR_CPR_MISMATCH",
    "PHASE_RESISTANCE_OUT_OF_RANGE",
    "PHASE_INDUCTANCE_OUT_OF_RANGE",
    "UNBALANCED_PHASES",
    "INVALID_MOTOR_TYPE",
    "ILLEGAL_HALL_STATE",
    "TIMEOUT",
    "HOMING_WITHOUT_ENDSTOP",
    "INVALID_STATE",
    "NOT_CALIBRATED",
    "NOT_CONVERGING",
)
"""Procedure_Result of the heartbeat: what became of the axis state that was asked for last."""
AXIS_STATE, ABSOLUTE_POSITION = struct.Struct("<I4x"), struct.Struct("<f4x")
"""Set_Axis_State and Set_Absolute_Position, as long as the maker's DBC has them."""
POSITION_CONTROL, PASSTHROUGH = 3, 1  # control and input mode
VEL_FF_SCALE: Final = 1000
"""Vel_FF in a turn a second, as axis0.config.can.input_vel_scale is shipped."""
LARGEST_VEL_FF: Final = 32767  # of a signed word of 16 bits
HEARTBEAT_S: Final = 0.02  # period that is set
INITIALIZING: Final = 1  # bit of ODrive.Error
_OVER_SPEED, _SENSOR, _SUPPLY, _INTERNAL = 3, 7, 9, 11  # `Fault` of the catalogue
ERRORS: Final[Mapping[int, tuple[str, int]]] = {
    0x2: ("SYSTEM_LEVEL", _INTERNAL),
    0x4: ("TIMING_ERROR", _INTERNAL),
    0x8: ("MISSING_ESTIMATE", _SENSOR),
    0x10: ("BAD_CONFIG", _INTERNAL),
    0x20: ("DRV_FAULT", _INTERNAL),
    0x40: ("MISSING_INPUT", _INTERNAL),
    0x100: ("DC_BUS_OVER_VOLTAGE", _SUPPLY),
    0x200: ("DC_BUS_UNDER_VOLTAGE", _SUPPLY),
    0x400: ("DC_BUS_OVER_CURRENT", OVER_CURRENT),
    0x800: ("DC_BUS_OVER_REGEN_CURRENT", OVER_CURRENT),
    0x1000: ("CURRENT_LIMIT_VIOLATION", OVER_CURRENT),
    0x2000: ("MOTOR_OVER_TEMP", OVER_TEMPERATURE),
    0x4000: ("INVERTER_OVER_TEMP", OVER_TEMPERATURE),
    0x8000: ("VELOCITY_LIMIT_VIOLATION", _OVER_SPEED),
    0x10000: ("POSITION_LIMIT_VIOLATION", _INTERNAL),
    0x1000000: ("WATCHDOG_TIMER_EXPIRED", TIME_TO_LIVE),
    0x2000000: ("ESTOP_REQUESTED", _INTERNAL),
    0x4000000: ("SPINOUT_DETECTED", _SENSOR),
    0x8000000: ("BRAKE_RESISTOR_DISARMED", _SUPPLY),
    0x10000000: ("THERMISTOR_DISCONNECTED", _SENSOR),
    0x40000000: ("CALIBRATION_ERROR", _SENSOR),
}
"""The bits of an axis error: its name, and the catalogue's code of a fault."""


def words_of(errors: int) -> str:
    """The names of the bits of an axis error."""
    known = [name for bit, (name, _) in ERRORS.items() if errors & bit]
    rest = errors & ~(INITIALIZING | sum(ERRORS))
    return ", ".join([*known, *([f"error 0x{rest:X}"] if rest else [])])


def code_of(errors: int) -> int:
    """The catalogue's code of a fault."""
    return next((code for bit, (_, code) in ERRORS.items() if errors & bit), _INTERNAL)


def result_of(result: int) -> str:
    """The name of a procedure's result."""
    return RESULTS[result] if result < len(RESULTS) else f"result {result}"
