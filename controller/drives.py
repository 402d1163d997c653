"""The drives that can be controlled, each declared once: limits, inverse, tuning, and their names on pages."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from controller.limits import Envelope, Limits
from controller.tuned import Correction, Expected, FilterNoise, PidGains
from models.drives.drive import Drive

Numbers = Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class Driven:
    """One drive, with the `name` of its kind of rig; numbers without a unit are in the command's unit.

    - `bounds`: the numbers of its `Envelope` from drive and limits. `placed`: the command is a carriage position;
      `shaken`: the command drives an inner mass (see `Envelope`).
    - `around_m`: half width of the envelope around the wanted position without a gap. `goes_on_m`: distance that the
      capsule travels beyond it before it is stopped. `tracked_m`: largest error of a capsule that follows a false
      position.
    - `models`: kinds of rig whose models fit the drive, `simulated`: the column that a simulation commands; both
      default to its own kind's. `leading`: its default controller.
    - `follow`: largest deviation of its report from recent commands; `rests`: largest deviation of a drive at rest from
      where it came to rest, or of its current from zero, in m or A.
    - `shown`: name, unit and factor of the command on a page, and its axis in simulation.
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
    """The gap in m at which the magnet pulls `force` in N on its stable branch; `most` if it never does."""
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
"""Evidence for the numbers of all drives. Of `push_wander_N` 20 to 100 mN and `slip_wander_m` 0.03 to 3 mm these erred
least over pushes, folds and a narrow segment, three seeds from 100 on.

PIDs `pid` and `pid_friction`: coordinate search over k_p, k_i, k_d and the filter for least tracking error on a ramp at
1 mm/s, a sine and steps, nominal plant, 8 s, seed 7 (`python -m tests.bench.bench_classical magnetic`); the coil's
filter with friction is that of its PID. `pid_estimated`: least error on a grid (k_p 25 to 200, k_i 60 to 1500, k_d 0 to
4) on the shipped ramp and sine (steps for the coil), nominal wall, seed 7, which no benchmark uses. `Expected`: guts
from 100 on of `tests/bench/bench_monitor.py`.
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
    goes_on_m=0.015,  # at half its speed limit for 0.1 s, the time to respond
    simulated="coil_voltage_V",
    pid=PidGains(100.0, 300.0, 0.5, jerkiness=5e-3),
    pid_friction=PidGains(100.0, 300.0, 2.0, jerkiness=5e-3),
    pid_estimated=PidGains(200.0, 400.0, 4.0),
    correction=Correction(gain_1_s=40.0, noise_m=0.4e-3, most_m_s=20e-3, reach_s=4e-3),
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
    tracked_m=0.006,  # without false positions 5.7 mm remain on ramp and sine, 0.5 mm with a coil
    models=("vibro", "vibro_table"),
    leading="vibro",
    noise=FilterNoise(slip_wander_m=4e-3),
    expected=Expected(least_m=1e-3, miss_m=1.3e-3, innovation=0.17, ahead=1.5, lacking=0.12),
    rests=0.012,
    shown=("Level", "%", 100.0, "drive on"),
)
"""The stroke of an inner mass depends on every parameter. With the position wander of the other drives the filter was
lost eight times in 16 s if the model moved four times too far; of 1 to 8 mm those from 2 on performed alike.
"""
DRIVES: Final[dict[str, Driven]] = {one.name: one for one in (CARRIAGE, COIL, INNER_MASS)}


def bodies() -> tuple[str, ...]:
    """The drives that push the body directly."""
    return tuple(name for name, driven in DRIVES.items() if not driven.shaken)


def driven_of(drive: Drive) -> Driven:
    """The declaration of `drive`. Raises ValueError for a drive that cannot be controlled."""
    if drive.name not in DRIVES:
        *others, last = DRIVES
        raise ValueError(f"drive must be {', '.join(others)} or {last} to be limited; got {drive.name!r}")
    return DRIVES[drive.name]


def envelope_of(drive: Drive, limits: Limits | None = None) -> Envelope:
    """`limits` (None: the defaults) in the unit of `drive`'s command. Carriage: its travel, and the gap at which the
    magnet pulls `force_N`, at most `gap_share` of that of the greatest pull. Coil: `current_A` and `force_N/k`, or the
    voltage for that current. Inner mass: 0 to the rated command; `force_N` does not limit what it puts on the tissue.
    Raises ValueError for a drive without a command to limit.
    """
    driven, limits = driven_of(drive), Limits() if limits is None else limits
    numbers = driven.bounds(drive, limits)
    return Envelope(limits=limits, placed=driven.placed, shaken=driven.shaken, without_gap_m=driven.around_m, **numbers)


class Actuator:
    """The static inverse of a drive at the parameters `p`: the command for a force in N at a position and speed, within
    the `envelope`, on the stable branch of a magnet. Raises ValueError for a drive that does not push the body.
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
        """The steady force in N of a constant command: the inverse of `command`."""
        if getattr(self._drive, "by_voltage", False):
            command = (command - self._p["back_emf_V_s_per_m"] * v) / self._p["coil_resistance_ohm"]
        return float(self._drive.force(x, v, command, self._p))
