"""Two columns in each other's place, and one that stands in two places."""

import numpy as np

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import Array, View, grid_step, white_noise


def check_pull_exchanged(view: View) -> list[RecordFinding]:
    """A stage follows its path more finely than a load cell weighs, and friction turns round with the motion: where
    neither holds, the columns are exchanged.
    """
    if not view.kind.drawn or not view.timed or view.driven is None or view.measured not in view.record.columns:
        return []
    place, noise = _coarse(view.record[view.driven]), _coarse(view.y)
    way = float(np.mean(np.abs(view.speed)))
    if not place > SET.exchanged_coarser * noise or not way:
        return []
    along = abs(float(np.mean(np.sign(view.y) * view.speed))) / way
    if along >= SET.exchanged_along:
        return []
    return [
        exchanged(
            view,
            view.driven,
            f"{view.driven} is noisier for its span than {view.measured}, which does not go with the direction of"
            " motion",
            f"noise {place:.2g} of the span against {noise:.2g}; force along {100 * along:.0f} % of the way",
        )
    ]


def check_same(view: View) -> list[RecordFinding]:
    """A measured column that is the driven one once more, in another unit at most."""
    if not view.timed or view.driven is None or not {view.driven, view.measured} <= set(view.record.columns):
        return []
    driven, span = view.record[view.driven], float(np.ptp(view.y))
    if not span or not np.ptp(driven):
        return []
    slope, offset = np.polyfit(driven, view.y, 1)
    if float(np.max(np.abs(view.y - slope * driven - offset))) > SET.same_column * span:
        return []
    return [
        view.finding(
            "columns_same",
            "stops",
            f"{view.measured} against {view.driven}, throughout",
            f"{view.measured} is {view.driven} times {slope:.6g}, without any noise: the same column was logged twice",
            f"a straight line leaves less than {SET.same_column:g} of the span",
            f"log what is measured, or give its column: {view.columns_line(view.measured, column='...')}",
        )
    ]


def exchanged(view: View, driven: str, why: str, how: str) -> RecordFinding:
    """The finding that the measured column and the `driven` one are in each other's place."""
    sources = view.rig.columns
    return view.finding(
        "columns_exchanged",
        "stops",
        f"{view.measured} against {driven}, throughout",
        f"{why}: the two columns are exchanged",
        how,
        f"{view.columns_line(view.measured, column=sources.entry(driven).column)} and"
        f" {view.columns_line(driven, column=sources.entry(view.measured).column).removeprefix('[columns] ')}",
    )


def _coarse(x: Array) -> float:
    """Noise or step of a column as a share of what nearly all of it spans."""
    span = float(np.ptp(np.percentile(x, (1, 99))))
    return max(white_noise(x), grid_step(x) / np.sqrt(12)) / span if span else 0.0
