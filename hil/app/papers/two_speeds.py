"""The base model's stick-slip over speed against what papers A and C measured at 0.5 and 10 mm/s."""

from collections.abc import Iterator

import numpy as np

from hil.app.papers.analytical import mean_of
from hil.app.papers.comparison import MN, Drawing, Plot, Row, at_speed, row, slug
from hil.app.papers.flat_car import measured_teeth
from hil.app.papers.viscoelastic import measured_band
from models.identification.kinds.periods import Cycle, PeriodsKind
from models.rigs.benches import PERIODS
from models.rigs.rig import Rig
from models.sets import load_measurement

SLOW, FAST = 0.5e-3, 10e-3  # m/s, papers A and C


def base_cycle(speed_m_s: float) -> Cycle:
    """The base model's tooth for the default capsule and gut, nothing fitted."""
    kind = PeriodsKind.from_rig(Rig(PERIODS.id, velocity_m_s=speed_m_s))
    return kind.cycle(speed_m_s, kind.nominal())


def two_speeds_rows() -> Iterator[Row]:
    """Period, valley and peak at both speeds."""
    measured = {
        SLOW: (mean_of("period_s"), mean_of("valley_N"), mean_of("peak_N")),
        FAST: (float(np.mean(measured_teeth("period"))), *measured_band()),
    }
    for v, values in measured.items():
        cycle, at = base_cycle(v), at_speed(v)
        computed = {"period": cycle.tooth.period_s, "valley": cycle.valley, "peak": cycle.peak}
        for (name, value), seen in zip(computed.items(), values, strict=True):
            key, unit = f"base_{name}_{slug(at)}", "s" if name == "period" else "mN"
            fill = {"name": name, "at": at}
            yield row(
                key, unit, value, "misses the measurement", "two_speeds", measured=seen, words="base_cycle", fill=fill
            )


def two_speeds_drawing() -> Drawing:
    """Period, valley and peak over speed."""
    plot = Plot("", "")
    plot.figure.set_subplots(rows=1, cols=2)
    speeds = np.geomspace(0.3e-3, 20e-3, 60)
    cycles = [base_cycle(v) for v in speeds]
    plot.line(speeds * MN, [c.tooth.period_s for c in cycles], "base model: period", "printed", row=1, col=1)
    table, band = load_measurement("analytical_table2_periods"), measured_band()
    for speed, periods in ((SLOW, table["period_s"]), (FAST, np.array(measured_teeth("period")))):
        name = f"measured periods at {at_speed(speed)}"
        plot.points(np.full(len(periods), speed * MN), periods, name, "circle", row=1, col=1)
    for name, colour in (("valley", "derived"), ("peak", "third")):
        forces = np.array([getattr(c, name) for c in cycles]) * MN
        plot.line(speeds * MN, forces, f"base model: {name}", colour, row=1, col=2)
    for name, symbol, slow, fast in (
        ("valleys", "diamond", table["valley_N"], band[0]),
        ("peaks", "triangle-up", table["peak_N"], band[1]),
    ):
        x = np.append(np.full(len(slow), SLOW * MN), FAST * MN)
        plot.points(x, np.append(slow, fast) * MN, f"measured {name}", symbol, row=1, col=2)
    plot.figure.update_xaxes(title="speed, mm/s", type="log").update_yaxes(title="period, s", type="log", col=1)
    plot.figure.update_yaxes(title="force, mN", type="log", col=2)
    first, last = (base_cycle(speed).tooth.period_s for speed in (SLOW, FAST))
    return plot.captioned("two_speeds", slow=first, fast=last)
