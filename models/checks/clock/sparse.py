"""A measured column that has no value in some rows."""

from models.checks.finding import RecordFinding
from models.checks.view import View
from models.records.record import USED


def check_sparse_values(view: View) -> list[RecordFinding]:
    """Cells of the measured column that the file leaves empty."""
    if USED not in view.record.columns:
        return []
    there = view.record[USED] > 0
    rate = 1 / view.dt
    return [
        view.finding(
            "sparse_values",
            "note",
            f"{view.measured}, throughout",
            f"{view.measured} has a value in {there.sum()} of {len(there)} rows: {rate * there.mean():.3g} a second,"
            f" where there are {rate:.4g} rows; it is compared in these",
            "empty cells",
            "leave them empty: a value that is filled in would count as measured",
        )
    ]
