"""When the supervisor changes over, and the record of it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Rules:
    """When the supervisor changes over, all in s but `late_allowed` (late answers in a row that are still used) and `rest_speed_m_s`.

    An answer later than `deadline_s` by the clock is late. A controller that failed is tried again after `retry_s`, twice as long after each further
    failure up to `retry_longest_s`, and forgiven after `forgive_s` of good work. Serious limits in force for `limit_s` on end count as a failure, so
    does turning about far from the aim for `limit_s` (a second of following takes 0.5 s off). After a lost estimate control resumes once it was good
    for `settle_s`. A change-over is blended over `blend_s`, a stop takes the current to 0 within `stop_s`. At rest: capsule and reference slower than
    `rest_speed_m_s` for `rest_s`.
    """

    late_allowed: int = 2
    deadline_s: float = math.inf
    retry_s: float = 0.25
    retry_longest_s: float = 4.0
    forgive_s: float = 2.0
    limit_s: float = 0.5
    settle_s: float = 0.05
    blend_s: float = 0.1
    stop_s: float = 0.1
    rest_speed_m_s: float = 2e-4
    rest_s: float = 0.2

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            if not getattr(self, name) >= 0:
                raise ValueError(f"rule {name} must be zero or more; got {getattr(self, name)!r}")


@dataclass(frozen=True)
class Event:
    """A change-over at `time_s`: from one controller to another, and why."""

    time_s: float
    before: str
    after: str
    reason: str
