"""Which signals say nothing, by a flag of their frame or a value of their own: an integer on the wire has no NaN."""

import math
from collections.abc import Mapping
from typing import Final

NO_SURPRISE: Final = -10.0  # a value on the wire that says that there is none
NOT_MEASURED_C: Final = -40.0  # the same of a temperature
_SENSOR: Final = ("Valid", 0.0)  # signal and value by which a sensor's frame says that it says nothing
_FLAGS: Final[Mapping[str, tuple[tuple[str, float], tuple[str, ...]]]] = {
    "CapsuleLocalisation": (_SENSOR, ("Position_m", "Quality", "Age_s")),
    "ForceReading": (_SENSOR, ("Force_N", "Age_s")),
    "BelievedMotion": (("Wall", 3.0), ("Position_m", "Std_m", "Surprise")),
    "ModelHealth": (("State", 3.0), ("Since_s", "Evidence")),
}
"""Frame: the flag that says so, and what then says nothing."""
_VALUES: Final[Mapping[str, float]] = {"Surprise": NO_SURPRISE, "Temperature_degC": NOT_MEASURED_C}
"""Signal: the value that stands for none."""


def without_absent(frame: str, values: Mapping[str, float]) -> dict[str, float]:
    """The signals of `frame`, NaN where they say nothing."""
    (flag, said), silent = _FLAGS.get(frame, (("", 0.0), ()))
    none = set(silent) if values.get(flag) == said and silent else set[str]()
    return {name: math.nan if name in none or value == _VALUES.get(name) else value for name, value in values.items()}
