"""What a monitor expects of a model that holds, by drive, from simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Expected:
    """Of seconds in which the capsule moved by `least_m` or more: `miss_m` is the standard deviation of the forecast's
    miss beside what begin and end are uncertain by, `innovation` that of the mean standardised innovation, `ahead`
    that of `Second.ahead`, `lacking` that of the force that the model lacks, as a share of its mean friction. `alarm`
    is the evidence of forecast, innovations and time that raises an alarm, `drift` that of the drift.

    Evidence is a logarithm of a likelihood ratio: with scales that are not too small and independent seconds, false
    alarms of one sum are e^alarm seconds of motion apart or more (Lorden 1971), 45 h with 12. The force that is
    lacking is alike over several seconds in an uneven gut, so `lacking` and `drift` stand for that: in 40 h along 80
    guts from 100 on (level and noise alone, without the loop) the sum stayed below 12.
    """

    least_m: float = 0.2e-3
    miss_m: float = 0.6e-3
    innovation: float = 0.12
    ahead: float = 1.4
    lacking: float = 0.09
    alarm: float = 14.0
    drift: float = 20.0


EXPECTED: Mapping[str, Expected] = MappingProxyType(
    {
        "magnetic": Expected(miss_m=0.1e-3, lacking=0.07),
        "coil": Expected(miss_m=0.7e-3),
        "vibro": Expected(least_m=1e-3, miss_m=1.3e-3, innovation=0.17, ahead=1.5, lacking=0.12),
    }
)
"""From guts from 100 on of `tests/bench/bench_monitor.py`."""
