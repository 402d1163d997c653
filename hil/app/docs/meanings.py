"""What the keys of deployments and scenarios mean, in a few words."""

from collections.abc import Mapping
from typing import Final

from models.rigs.schema import field_of
from models.rigs.tables import Checks, Drive

MEANINGS: Final[Mapping[str, str]] = {
    **{key: field_of(table, key).description or "" for table, key in ((Checks, "accept"), (Drive, "force_N"))},
    "interface": "name of the python-can interface, such as `socketcan`, or `capsule_local` between processes",
    "channel": "its channel, such as `can0`",
    "bitrate": "bit rate, which must be that of `hil/capsule.dbc`",
    "force_sensor": "whether the force sensor speaks, too",
    "longest_s_per_s": "wall clock that a simulated second may take before the run is failed; a run has 60 s at least",
    "script": "what an operator does from the run's begin on, in lines as `capsule jog --script` reads them:"
    " `speed MM_S SECONDS`, `position MM SECONDS`, `release SECONDS`, which comes first; released after them",
    "source": "who steers, by the names of `OperatorSetpoint`",
    "life_ms": "how long each setpoint counts, from its arrival less what it was held back on the way",
    "key_file": "file with the key of authenticated frames, this user's alone (0600), relative to this one; needs `fd`",
    "controller": "name of the controller",
    "estimator": "`default` goes with the controller; `ukf` is filterpy's unscented Kalman filter, about ten times as"
    " costly, to compare with",
    "tick_s": "period of the control loop",
    "seen_noise_m": "standard deviation of the localisation that the estimator expects",
    "resolution_m": "pixels or steps of the localisation, 0 where they are finer than its noise",
    "duration_s": "how long to run",
    "give_up_s": "how long the drive may take to be enabled, localisation included, before the run is given up",
    "priority": "1 to 99 asks for the real-time scheduler SCHED_FIFO, 0 does not",
    "core": "processor core to run on, -1 for any",
    "probe": "whether a short motion to and fro (5 mm behind a magnet, 3 mm else) shows that the capsule answers the"
    " drive before the reference begins, unless setpoints of an operator are taken; over a simulated bus the reference"
    " then begins where the capsule is",
    "envelope_m": "farthest that carriage and capsule may be from the wanted position; 0: the magnet's gap of greatest"
    " pull, 10 mm for a coil, 20 mm for an inner mass",
    "judged_from_s": "time from which tracking errors count",
    "speed_mm_s": "speed of the move",
    "start_s": "time at which the move begins",
    "amplitude_mm": "distance out and back",
    "frequency_Hz": "frequency of the sine",
    "positions_mm": "positions to visit in turn",
    "position_mm": "position to hold",
    "dwell_s": "rest at each position",
    "times_s": "time of each position",
    "speed_m_s": "greatest speed of the capsule; in `[operator]`, of the reference that setpoints lead",
    "sources": "senders whose setpoints are taken, by the names of `OperatorSetpoint`; empty: all",
    "acceleration_m_s2": "greatest acceleration of that reference",
    "lowest_m": "lowest position that it goes to, as the localiser tells it",
    "highest_m": "highest position",
    "stop_after_s": "how long the capsule is held after the dead-man switch has been released, or a setpoint has come"
    " late, before the drive is stopped",
    "drift_share": "share by which a sender's setpoints may come slower than every 20 ms; a delay on the way that grows"
    " by less is not noticed",
    "carriage_speed_m_s": "greatest speed of the carriage",
    "first_speed_m_s": "speed of the carriage that is allowed as a run on a rig enables it; of a coil's or inner mass's"
    " range the same share",
    "first_acceleration_m_s2": "by which that speed (or share) grows until all of it is allowed",
    "carriage_acceleration_m_s2": "greatest acceleration of the carriage",
    "travel_m": "greatest distance of the carriage from its zero",
    "gap_share": "share of the gap of greatest pull that may be used",
    "gap_stds": "standard deviations of the estimated position by which the gap is held smaller",
    "current_A": "greatest coil current",
    "current_rate_A_s": "fastest change of the coil current",
    "temperature_C": "temperature at which the drive is switched off",
    "derate_C": "temperature from which its range shrinks",
    "age_s": "age of the last localisation at which the drive is stopped",
    "longest_tick_s": "longest pause that counts when a command's rate is limited",
    "file": "`model.toml` that `capsule close-loop` wrote, relative to this file",
    "report": "the `report.json` beside it",
    "stage": "`nominal`, `calibrated` or `augmented`",
    "experiment_mm": "how far to either side of where the reference rests an experiment may lead the capsule that the"
    " search asks for; 0: none is driven",
    "experiment_mm_s": "speed of an experiment's own strokes, which go at half and twice of it, too",
    "experiment_s": "how long an experiment lasts at most, the way back apart",
    "gathered_s": "how much of what is measured since the model broke is asked about, with `--learn`",
    "held_out_share": "share of it, at its end, on which what was found is judged",
    "answer_s": "how long simulated time waits for an answer; on a real bus it comes when it comes",
    "trial_s": "how long a model that was taken is on trial",
    "worse": "it is taken back where its tracking error is this many times that of as long before",
    "at_s": "time from which the model is offered; it takes over at the next rest",
    "fd": "opens the interface for CAN FD",
    "data_bitrate": "bit rate of the data of CAN FD frames",
    "sample_point": "where a bit is sampled, as a share of it, with `fd`",
    "data_sample_point": "likewise a bit of the data",
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
    "fmu": "FMU that stands in for the simulated plant, relative to the scenario; `capsule sil` alone reads it",
    "scenario": "scenario whose plant `capsule plant` simulates, relative to this file; the controller never reads it",
}
