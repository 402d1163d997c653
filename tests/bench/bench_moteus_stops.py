"""How far and how long a moteus's carriage goes on at full speed: after the last command, and on a quick stop.

`python -m tests.bench.bench_moteus_stops`: a line a setting, beside the stated time; 1 where
one took longer than that and a tick. Lines that end in "refused" show why set-up refuses that setting.
"""

import argparse
import math
import sys
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from controller.limits import Limits
from hil.drives.moteus_protocol import MoteusTable
from hil.nodes.frame_map import ENABLE, QUICK_STOP
from hil.simulated.moteus_drive import MoteusDrive
from tests.hil.drives.maker_desk import WIRING, Desk
from tests.hil.ticks import TICK

SPEED_M_S: Final = Limits().carriage_speed_m_s
SETTINGS: Final[Mapping[str, tuple[MoteusTable, float, float]]] = MappingProxyType(
    {
        "timeout_mode 12 (as shipped)": (MoteusTable(), 12.0, 50.0),
        "timeout_mode 15": (MoteusTable(), 15.0, 50.0),
        "timeout_mode 10, accel nan": (MoteusTable(), 10.0, math.nan),
        "timeout_mode 10, accel 500": (MoteusTable(), 10.0, 500.0),
        "timeout_mode 10, accel 50, coast 0.5": (MoteusTable(coast_m_s2=0.5), 10.0, 50.0),
        "timeout_mode 10, accel 50: refused": (MoteusTable(), 10.0, 50.0),
        "timeout_mode 0: refused": (MoteusTable(), 0.0, 50.0),
    }
)
"""Of a moteus: table, servo.timeout_mode, servo.default_accel_limit in turns/s2."""


def led(table: MoteusTable, mode: float, limit: float) -> Desk:
    """A desk whose carriage goes at full speed."""
    desk = Desk(table, booted=False)
    desk.drive.configure(WIRING.life_ms(SPEED_M_S))
    if isinstance(desk.drive, MoteusDrive):
        desk.drive.settings |= {"servo.timeout_mode": mode, "servo.default_accel_limit": limit}
    desk.ticks(50, 0)
    desk.up()
    desk.ticks(200, ENABLE, SPEED_M_S)
    if abs(desk.drive.power.output - desk.place) > 4 * SPEED_M_S * TICK:
        raise RuntimeError(f"the drive must follow; it is at {desk.drive.power.output:g} m, not {desk.place:g} m")
    return desk


def silence(desk: Desk) -> tuple[float, float]:
    """Way in m and time in s from the last command to the carriage at rest."""
    before, began = desk.drive.power.output, desk.now
    while not desk.drive.safe and desk.now < began + 2.0:
        desk.ticks(1, ENABLE, silent=True)
    return abs(desk.drive.power.output - before), desk.now - began


def quick_stop(desk: Desk) -> tuple[float, float]:
    """The same from the order to stop."""
    before = desk.drive.power.output
    took = desk.until_safe(QUICK_STOP)
    return abs(desk.drive.power.output - before), took


def main() -> int:
    """Print what each one takes."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    late = 0
    print(f"from {SPEED_M_S:g} m/s{'':44s}last command       stated   quick stop")
    for words, (table, mode, limit) in SETTINGS.items():
        way, took = silence(led(table, mode, limit))
        stop_way, stop_took = quick_stop(led(table, mode, limit))
        stated = table.stops_s(SPEED_M_S)
        late += took > stated + TICK and not words.endswith("refused")
        print(
            f"moteus   {words:38s} {1e3 * way:6.1f} mm {1e3 * took:6.1f} ms {1e3 * stated:6.1f} ms"
            f" {1e3 * stop_way:6.1f} mm {1e3 * stop_took:6.1f} ms",
            flush=True,
        )
    return int(late > 0)


if __name__ == "__main__":
    sys.exit(main())
