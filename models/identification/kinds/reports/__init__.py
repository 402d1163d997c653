"""What the report says about each kind of rig, a file a kind: equations, statements, the next experiment."""

from collections.abc import Mapping
from types import ModuleType
from typing import Any, Final

from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.driven import DrivenAxisKind
from models.identification.kinds.dma import DmaKind
from models.identification.kinds.friction import FrictionKind
from models.identification.kinds.periods import PeriodsKind
from models.identification.kinds.reports import axis, dma, friction, periods, series, vibro_table
from models.identification.kinds.series.series import SeriesKind
from models.identification.kinds.vibro_table import VibroTableKind

AnyKind = AxisKind | DmaKind | FrictionKind | SeriesKind | PeriodsKind | VibroTableKind
_REPORTS: Final[Mapping[type, ModuleType]] = {
    AxisKind: axis,
    DrivenAxisKind: series,
    DmaKind: dma,
    FrictionKind: friction,
    PeriodsKind: periods,
    VibroTableKind: vibro_table,
    SeriesKind: series,
}


def report_of(kind: AnyKind) -> Any:
    """The module with the words for models of `kind`: `equations(kind, theta)` with their numbers, a line each;
    `statements(kind, theta_by_stage, records)` on the limits of these data and the residual; and
    `next_experiment(kind, theta, records, alike)` that would separate each effect from those that the records do not
    separate from it (`alike`), None where none is needed.
    """
    return next(_REPORTS[one] for one in type(kind).__mro__ if one in _REPORTS)
