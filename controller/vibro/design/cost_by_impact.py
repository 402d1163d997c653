"""What a mean speed costs with every kind of impact: without, at the front stop, at the rear one, at both."""

from dataclasses import dataclass
from typing import Literal

from controller.vibro.cycles import IMPACTS, Cycles, Gait, Impact, impact_of
from controller.vibro.design.speed_map import SpeedMap, best_square
from controller.vibro.gears import DriveMap
from controller.vibro.waveform import Waveform

Shape = Literal["square", "optimal", "map"]


@dataclass(frozen=True)
class Alternative:
    """One way to go at a mean speed: the `waveform` with what it does, the stop that it strikes and where it comes
    from: a square wave, the optimiser, or the drive map that a controller runs on.
    """

    waveform: Waveform
    pace: Gait
    impact: Impact
    shape: Shape


def squares(cycles: Cycles, table: SpeedMap, speed_m_s: float) -> list[Alternative]:
    """The cheapest square wave at `speed_m_s` of every kind of impact that the map `table` has there."""
    found = ((impact, best_square(cycles, table, speed_m_s, impact=impact)) for impact in IMPACTS)
    return [Alternative(*best, impact, "square") for impact, best in found if best is not None]


def from_map(cycles: Cycles, drive: DriveMap, speed_m_s: float) -> Alternative:
    """What the `drive` map makes of the commanded `speed_m_s`."""
    wave = drive.choose(speed_m_s).waveform
    pace = cycles.pace(wave)
    return Alternative(wave, pace, impact_of(cycles.model, pace), "map")
