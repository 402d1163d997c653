"""What the keys of other makers' drives and of an operator mean, in a few words."""

from collections.abc import Mapping
from typing import Final

MEANINGS: Final[Mapping[str, str]] = {
    "accept": "whether the controller takes setpoints from the bus",
    "speed_m_s": "greatest speed of the reference that setpoints lead",
    "sources": "senders whose setpoints are taken, by the names of `OperatorSetpoint`; empty: all",
    "acceleration_m_s2": "greatest acceleration of that reference",
    "lowest_m": "lowest position that it goes to, as the localiser tells it",
    "highest_m": "highest position",
    "stop_after_s": "how long the capsule is held after the dead-man switch has been released, or a setpoint has come"
    " late, before the drive is stopped",
    "drift_share": "share by which a sender's setpoints may come slower than every 20 ms; a delay on the way that grows"
    " by less is not noticed",
    "node_id": "node of the carriage's drive, clear of the catalogue's identifiers",
    "counts_per_m": "its position counts, per metre",
    "answers_s": "how long it may take to answer",
    "mode": "what the drive is led by: places or speeds, both cyclic and synchronous",
    "velocity_gain_Hz": "led by `velocity`: share of what the carriage is off its place that a second makes up for",
    "homing_method": "object 0x6098: how the drive finds its zero as it is set up, by its own motion; 0: not at all",
    "homing_speed_m_s": "object 0x6099: its speed then",
    "homing_s": "how long that may take",
    "following_m": "object 0x6065, led by places: this far off its target for `following_s` the drive must say so, and"
    " is stopped; 0: 0x6065 and 0x6066 are left as they are",
    "following_s": "object 0x6066: how long it may be so far off",
    "options": "objects of the drive's own, index and sub hexadecimal, each written and read back",
    "turns_per_m": "turns that it tells (an ODrive its motor's, a moteus its output's, behind"
    " `motor_position.rotor_to_output_ratio`), per metre of the carriage; negative: the other way",
    "endpoints": "further ids of `flat_endpoints.json`, by path, of what is read back then (`docs/bus.md` lists them);"
    " what is not stated is told as not asked for",
    "firmware": "its firmware, whose endpoint ids the next two are; another one is refused",
    "enable_watchdog_endpoint": "endpoint id of `axis0.config.enable_watchdog` in its `flat_endpoints.json`; 0: not"
    " stated, and it is not led",
    "watchdog_timeout_endpoint": "endpoint id of `axis0.config.watchdog_timeout`, likewise",
    "watchdog_s": "longest time without a command after which its own watchdog must have stopped it",
    "coast_m_s2": "deceleration of the carriage without torque, by the friction of its guide and screw: measure it",
    "motor_current_A": "most current of its motor (Set_Limits)",
    "most_torque_N_m": "most torque at its output",
    "home": "`kept`: its own zero (a moteus: home state 2, known at the output); `here`: the place where it stands as"
    " it is set up",
}
