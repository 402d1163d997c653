"""How far a carriage of another maker goes on from full speed once its controller is lost, against what its table
states.

`python -m tests.bench.bench_stops [--drives odrive cia402] [--speeds 0.25] [--phases 20]` leads each simulated drive at
a constant speed over a simulated wire, falls silent at `phases` instants spread over a tick and the drive's own cycles,
and prints the longest way and time from the last command to rest, both ways.
"""

import argparse
from dataclasses import dataclass

from hil.drives.makers import ACTUATORS
from hil.drives.table import TurningTable
from hil.nodes.frame_map import ENABLE, QUICK_STOP, frame_map_of
from tests.hil.drives.maker_desk import LIMITS, Desk
from tests.hil.ticks import TICK

PHASES = 20
_UP_TICKS = 60
_MOST_TICKS = 1000


@dataclass(frozen=True)
class Stopped:
    """From the last command on: the way in m and the time in s until the drive is in its safe state."""

    way_m: float
    time_s: float


def led(name: str, speed_m_s: float, ticks: int) -> Desk:
    """The drive `name` at a constant speed for `ticks`."""
    desk = Desk(ACTUATORS[name](), booted=False)
    desk.drive.configure(frame_map_of("magnetic").life_ms(LIMITS.carriage_speed_m_s))
    desk.ticks(50, 0)
    desk.up()
    desk.ticks(ticks, ENABLE, speed_m_s)
    if abs(desk.drive.power.rate - speed_m_s) > 0.02 * abs(speed_m_s):  # type: ignore[attr-defined]
        raise RuntimeError(f"{name} must go {speed_m_s:g} m/s before its controller is lost")
    return desk


def stopped(name: str, speed_m_s: float, phase: int, *, told: bool = False) -> Stopped:
    """The drive's way to rest without its controller, or, where `told`, with a stop of the controller's."""
    desk = led(name, speed_m_s, _UP_TICKS + phase)
    place, since = desk.drive.power.output, desk.now
    desk.ticks(1, ENABLE, speed_m_s)
    for _ in range(_MOST_TICKS):
        if desk.drive.safe:
            return Stopped(abs(desk.drive.power.output - place), desk.now - since)
        desk.ticks(1, QUICK_STOP, silent=not told)
    raise RuntimeError(f"{name} must come to rest without its controller; it goes on for {_MOST_TICKS * TICK:g} s")


def worst(name: str, speed_m_s: float, phases: int = PHASES, *, told: bool = False) -> Stopped:
    """The longest of both ways and all phases."""
    found = [stopped(name, sign * speed_m_s, phase, told=told) for phase in range(phases) for sign in (1, -1)]
    return Stopped(max(one.way_m for one in found), max(one.time_s for one in found))


def stated(name: str, speed_m_s: float) -> Stopped:
    """What the drive's table states: at the same speed until its watchdog has expired, then braked or coasting."""
    table, frame_map = ACTUATORS[name](), frame_map_of("magnetic")
    if isinstance(table, TurningTable):
        slows_m_s2, live_s = table.coast_m_s2, table.watchdog_s
    else:
        slows_m_s2, live_s = frame_map.braking_m_s2, 1e-3 * frame_map.life_ms(speed_m_s)
    return Stopped(speed_m_s * live_s + speed_m_s**2 / (2 * slows_m_s2), table.stops_s(speed_m_s))


def words(name: str, speed_m_s: float, phases: int) -> str:
    """A line of what is measured and stated."""
    lost, told = worst(name, speed_m_s, phases), worst(name, speed_m_s, phases, told=True)
    most = stated(name, speed_m_s)
    return (
        f"{name:8} {speed_m_s:g} m/s: controller lost {1e3 * lost.way_m:.1f} mm in {1e3 * lost.time_s:.0f} ms (stated"
        f" {1e3 * most.way_m:.1f} mm, {1e3 * most.time_s:.0f} ms); told to stop {1e3 * told.way_m:.1f} mm in"
        f" {1e3 * told.time_s:.0f} ms"
    )


def main() -> None:
    """A line a drive and speed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", nargs="*", choices=list(ACTUATORS), default=list(ACTUATORS))
    parser.add_argument("--speeds", nargs="*", type=float, default=[LIMITS.carriage_speed_m_s])
    parser.add_argument("--phases", type=int, default=PHASES)
    asked = parser.parse_args()
    for name in asked.drives:
        for speed in asked.speeds:
            print(words(name, speed, asked.phases), flush=True)


if __name__ == "__main__":
    main()
