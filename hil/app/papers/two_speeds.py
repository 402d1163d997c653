"""The base model's stick-slip over speed against what papers A and C measured at 0.5 and 10 mm/s."""

from collections.abc import Iterator

import numpy as np

from hil.app.papers.analytical import mean_of
from hil.app.papers.drawing import DERIVED, PRINTED, THIRD, Drawing, axes, line, points
from hil.app.papers.flat_car import measured_teeth
from hil.app.papers.row import Row, Verdict, row, speed_key
from hil.app.papers.viscoelastic import measured_band
from models.identification.kinds.periods import Cycle, PeriodsKind
from models.rigs.benches import PERIODS
from models.rigs.rig import Rig
from models.sets import load_measurement

SLOW, FAST = 0.5e-3, 10e-3  # m/s, papers A and C


_MN = 1e3  # in a newton


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
    miss: Verdict = "misses the measurement"
    note = (
        "default capsule, nothing fitted, against A Table 2 and C, A 5.1: the measured period rises with speed, the"
        " base model's falls, whatever is fitted"
    )
    for v, values in measured.items():
        cycle = base_cycle(v)
        for name, unit, computed, seen in (
            ("period", "s", cycle.tooth.period_s, values[0]),
            ("valley", "mN", cycle.valley, values[1]),
            ("peak", "mN", cycle.peak, values[2]),
        ):
            quantity = f"base model: {name} at {v * 1e3:g} mm/s"
            yield row(f"base_{name}_{speed_key(v)}", quantity, unit, computed, miss, note, measured=seen)


def two_speeds_drawing() -> Drawing:
    """Period, valley and peak over speed."""
    figure = axes("", "").set_subplots(rows=1, cols=2)
    speeds = np.geomspace(0.3e-3, 20e-3, 60)
    cycles = [base_cycle(v) for v in speeds]
    line(figure, speeds * _MN, [c.tooth.period_s for c in cycles], "base model: period", PRINTED, row=1, col=1)
    table, band = load_measurement("analytical_table2_periods"), measured_band()
    for speed, periods in ((SLOW, table["period_s"]), (FAST, np.array(measured_teeth("period")))):
        name = f"measured periods at {speed * _MN:g} mm/s"
        points(figure, np.full(len(periods), speed * _MN), periods, name, "circle", row=1, col=1)
    for name, colour in (("valley", DERIVED), ("peak", THIRD)):
        forces = np.array([getattr(c, name) for c in cycles]) * _MN
        line(figure, speeds * _MN, forces, f"base model: {name}", colour, row=1, col=2)
    for name, symbol, slow, fast in (
        ("valleys", "diamond", table["valley_N"], band[0]),
        ("peaks", "triangle-up", table["peak_N"], band[1]),
    ):
        x = np.append(np.full(len(slow), SLOW * _MN), FAST * _MN)
        points(figure, x, np.append(slow, fast) * _MN, f"measured {name}", symbol, row=1, col=2)
    figure.update_xaxes(title="speed, mm/s", type="log")
    figure.update_yaxes(title="period, s", type="log", col=1)
    figure.update_yaxes(title="force, mN", type="log", col=2)
    caption = (
        "The base model (default capsule and gut, nothing fitted) against the eight periods of A's Table 2 and the"
        " three runs of C at 10 mm/s, whose valley and peak A's Section 5.1 gives. The measured period rises with"
        f" speed, the model's falls from {base_cycle(SLOW).tooth.period_s:.3f} to {base_cycle(FAST).tooth.period_s:.3f}"
        " s; no calibration of its numbers changes that. Other specimens and capsules of the same size."
    )
    return Drawing("A Table 2, C and A 5.1: stick-slip at two speeds", caption, figure)
