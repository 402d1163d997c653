"""The table `[learning]`: how a run with `--learn` goes about it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from models.files.tables import check_ranges, from_table

PACE_RANGES: Final = (
    ("gathered_s", 10.0, 240.0),
    ("held_out_share", 0.1, 0.5),
    ("answer_s", 1.0, math.inf),
    ("trial_s", 5.0, 600.0),
    ("worse", 0.5, 2.0),
    ("experiment_mm", 0.0, 50.0),
    ("experiment_mm_s", 0.1, 50.0),
    ("experiment_s", 4.0, 60.0),
)


@dataclass(frozen=True)
class Pace:
    """How much of motion and rest is gathered since the model broke (`gathered_s`), of which the last `held_out_share`
    is held out; how long an answer may take (`answer_s`: simulated time then waits for it; inf: it comes when it
    comes); how long a learned model is on trial (`trial_s`). It is taken back where its tracking error is `worse` times
    what it was over as long before. Where what was gathered does not suffice, an experiment of about `experiment_s` is
    driven that leads up to `experiment_mm` (0: none is) to either side of where the reference rests, its own strokes at
    about `experiment_mm_s`.
    """

    gathered_s: float = 75.0
    held_out_share: float = 0.2
    answer_s: float = 60.0
    trial_s: float = 60.0
    worse: float = 1.0
    experiment_mm: float = 0.0
    experiment_mm_s: float = 2.0
    experiment_s: float = 20.0

    def __post_init__(self) -> None:
        check_ranges(self, "learning", PACE_RANGES)


def read_pace(raw: Mapping[str, Any]) -> Pace:
    """The table of a deployment or a scenario; ValueError of one sentence for what it cannot be."""
    return from_table(Pace, raw.get("learning", {}), "learning")
