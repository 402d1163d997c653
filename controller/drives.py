"""The drives that can be led, each declared once: limits, inverse, what its loop is tuned by, what pages call it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from controller.limits import Envelope, Limits
from controller.model.control_model import ControlModel, mean_friction
from controller.tuned import Correction, Expected, FilterNoise, PidGains
from models.drives.drive import Drive

Numbers = Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Driven:
    """One drive, `name` that of its kind of rig; numbers without a unit are in the command's.

    `bounds`: the numbers of its `Envelope` from the drive and the limits. `placed`: the command is the place of a
    carriage, which rests where it is; every other one rests at 0. `shaken`: an inner mass is driven, which cycles move
    and no force on the body. `around_m`: half width of the envelope around the wanted position where no gap sets one;
    `goes_on_m`: how far the capsule goes on beyond it until it is found out and stopped; `tracked_m`: how far one that
    follows a lie may be from the place that it says. `models`: the kinds of rig whose models it is led by, `simulated`:
    the column that a simulation commands, each its own kind's where empty. `leading`: the controller where none is
    named. `follow`: how far its report may be beyond the commands of late; `rests`: how far a drive at rest may be off
    where it came to rest, or its current off zero, in m or A. `shown`: name, unit and factor of the command on a page,
    and its axis where it is simulated.
    """

    name: str
    bounds: Callable[[Any, Limits], dict[str, float]]
    placed: bool = False
    shaken: bool = False
    around_m: float = 0.01
    goes_on_m: float = 0.0
    tracked_m: float = 0.004
    models: tuple[str, ...] = ()
    simulated: str = ""
    leading: str = "feedforward"
    pid: PidGains = PidGains()
    pid_friction: PidGains = PidGains()
    pid_estimated: PidGains = PidGains()
    correction: Correction = Correction()
    noise: FilterNoise = FilterNoise()
    expected: Expected = Expected()
    follow: float = math.inf
    rests: float = math.inf
    shown: tuple[str, str, float, str] = ("", "", 1.0, "")


def gap_of_force(force: float, drive: Drive, p: Numbers, most: float) -> float:
    """The gap in m at which the magnet pulls `force` in N on its stable branch; `most` where it never does."""
    if drive.force(0.0, 0.0, most, p) <= force:
        return most
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if drive.force(0.0, 0.0, middle, p) <= force else (low, middle)
    return low


def _carriage(drive: Any, limits: Limits) -> dict[str, float]:
    nominal = {p.name: p.value for p in drive.parameters()}
    return {
        "low": -limits.travel_m,
        "high": limits.travel_m,
        "rate": limits.carriage_speed_m_s,
        "acceleration": limits.carriage_acceleration_m_s2,
        "gap_m": gap_of_force(limits.force_N, drive, nominal, limits.gap_share * drive.gap_limit_m),
    }


def _coil(drive: Any, limits: Limits) -> dict[str, float]:
    gain = drive.force_constant_N_per_A
    most = limits.current_A if gain == 0 else min(limits.current_A, limits.force_N / abs(gain))
    sense = math.copysign(1.0, gain)
    if not drive.by_voltage:
        return {"low": -most, "high": most, "rate": limits.current_rate_A_s, "sense": sense}
    volts = min(most, drive.winding.current_limit_A) * drive.winding.resistance_ohm
    return {"low": -volts, "high": volts, "sense": sense}


_BODY: Final = FilterNoise(
    position_wander_m=3e-5, slip_wander_m=1e-3, force_wander_N=3e-4, push_wander_N=60e-3, level_std=0.15
)
"""Of `push_wander_N` (20, 40, 60 and 100 mN) and `slip_wander_m` (0.03, 0.1, 1 and 3 mm) these erred least over pushes,
folds and a narrow place, three seeds from 100 on; straight traverses lose a little by it, 0.01 mm where a coil's is
slow.

Gains and filters of the PIDs `pid` and `pid_friction`: coordinate search over k_p, k_i, k_d and the filter together for
the least tracking error of a ramp at 1 mm/s, a sine and steps with rests on a nominal plant, 8 s each, seed 7, noise as
everywhere: `python -m tests.bench.bench_classical magnetic`. The filter of the coil's PID with friction was taken over
from the coil's PID. `pid_estimated`: least tracking error of a small grid (k_p 25 to 200, k_i 60 to 1500, k_d 0 to 4)
on the shipped ramp and sine, the shipped steps for the coil, with a nominal wall, 8 to 10 s, seed 7, on the same
estimates that the other controllers get. No benchmark judges on that seed.

What a monitor expects is from guts from 100 on of `tests/bench/bench_monitor.py`.
"""
CARRIAGE: Final = Driven(
    name="magnetic",
    bounds=_carriage,
    placed=True,
    pid=PidGains(100.0, 300.0, 1.0, jerkiness=5e-3),
    pid_friction=PidGains(20.0, 100.0, 2.0, jerkiness=1e-3),
    pid_estimated=PidGains(200.0, 1200.0, 2.0),
    noise=_BODY,
    expected=Expected(miss_m=0.1e-3, lacking=0.07),
    follow=1e-3,
    rests=3e-4,
    shown=("Carriage", "mm", 1e3, "carriage in mm"),
)
COIL: Final = Driven(
    name="coil",
    bounds=_coil,
    around_m=0.01,  # a third of a capsule's length
    goes_on_m=0.015,  # at half its speed limit for 0.1 s, which is what its answer takes
    simulated="coil_voltage_V",
    pid=PidGains(100.0, 300.0, 0.5, jerkiness=5e-3),
    pid_friction=PidGains(100.0, 300.0, 2.0, jerkiness=5e-3),
    pid_estimated=PidGains(200.0, 400.0, 4.0),
    correction=Correction(pace_1_s=40.0, noise_m=0.4e-3, most_m_s=20e-3, reach_s=4e-3),
    noise=_BODY,
    expected=Expected(miss_m=0.7e-3),
    follow=0.075,
    rests=0.012,
    shown=("Current", "A", 1.0, "coil voltage in V"),
)
INNER_MASS: Final = Driven(
    name="vibro",
    bounds=lambda drive, limits: {"low": 0.0, "high": abs(drive.command_unit)},
    shaken=True,
    around_m=0.02,  # two thirds of a capsule's length
    goes_on_m=0.005,
    tracked_m=0.006,  # no lie, on the bench's ramp and sine, leaves 5.7 mm, and 0.5 mm under a coil
    models=("vibro", "vibro_table"),
    leading="vibro",
    noise=FilterNoise(slip_wander_m=4e-3),
    expected=Expected(least_m=1e-3, miss_m=1.3e-3, innovation=0.17, ahead=1.5, lacking=0.12),
    rests=0.012,
    shown=("Level", "%", 100.0, "drive on"),
)
"""How far a stroke of an inner mass carries hangs on every parameter: with the position's common wander a filter that
believed four times too far ran ahead until it was lost, eight times in 16 s; of 1 to 8 mm those from 2 on did alike.
"""
DRIVES: Final[dict[str, Driven]] = {one.name: one for one in (CARRIAGE, COIL, INNER_MASS)}


def bodies() -> tuple[str, ...]:
    """The drives that push a body directly."""
    return tuple(name for name, driven in DRIVES.items() if not driven.shaken)


def driven_of(drive: Drive) -> Driven:
    """The declaration of `drive`. Raises ValueError for a drive that cannot be led."""
    if drive.name not in DRIVES:
        *others, last = DRIVES
        raise ValueError(f"drive must be {', '.join(others)} or {last} to be limited; got {drive.name!r}")
    return DRIVES[drive.name]


def envelope_of(drive: Drive, limits: Limits | None = None) -> Envelope:
    """`limits` (the default ones where None) in the unit of `drive`'s command. A carriage: its travel, and the gap at
    which the magnet pulls `force_N`, at most `gap_share` of that of the greatest pull. A coil: `current_A` and
    `force_N/k`, or the voltage that holds it. An inner mass: 0 to the rated command; `force_N` does not reach what it
    puts on the tissue, the body's friction. Raises ValueError for a drive without a command to limit.
    """
    driven, limits = driven_of(drive), Limits() if limits is None else limits
    numbers = driven.bounds(drive, limits)
    return Envelope(limits=limits, placed=driven.placed, shaken=driven.shaken, without_gap_m=driven.around_m, **numbers)


class Actuator:
    """The static inverse of a drive at the parameters `p`: the command that pushes with a force in N at a place and
    speed, within the range of the `envelope`; a carriage's on the stable branch of its magnet. Raises ValueError for a
    drive that pushes no body.
    """

    def __init__(self, drive: Any, p: Numbers, envelope: Envelope) -> None:
        if drive.name not in bodies():
            raise ValueError(f"drive must be {' or '.join(bodies())} for a PID on the force; got {drive.name!r}")
        self._drive, self._p, self._envelope = drive, p, envelope

    def command(self, force: float, x: float, v: float) -> float:
        """Command in the drive's unit for `force` in N at `x` in m and `v` in m/s."""
        e = self._envelope
        if e.placed:
            return x + math.copysign(gap_of_force(abs(force), self._drive, self._p, e.gap_m), force)
        return min(max(float(self._drive.command_for(force, x, v, self._p)), e.low), e.high)

    def force(self, command: float, x: float, v: float) -> float:
        """The force in N of a command held for long: the inverse of `command`."""
        if getattr(self._drive, "by_voltage", False):
            command = (command - self._p["back_emf_V_s_per_m"] * v) / self._p["coil_resistance_ohm"]
        return float(self._drive.force(x, v, command, self._p))


def friction_command(model: ControlModel, envelope: Envelope) -> float:
    """The command that overcomes a coil's mean friction; inf for other drives, which have a place or push no body."""
    if envelope.placed or envelope.shaken:
        return math.inf
    actuator = Actuator(model.drive, model.theta.base, envelope)
    return max(abs(actuator.command(mean_friction(model), 0.0, 0.0)), 1e-9)
