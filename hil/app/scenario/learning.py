"""The table `[learning]`: how a run with `--learn` goes about it."""

from __future__ import annotations

from dataclasses import dataclass

from models.files.tables import Declared, limited


@dataclass(frozen=True)
class Pace(Declared, where="learning"):
    """How much of motion and rest is gathered since the model broke (`gathered_s`), of which the last `held_out_share`
    is held out; how long an answer may take (`answer_s`: simulated time then waits for it; inf: it comes when it
    comes); how long a learned model is on trial (`trial_s`). It is taken back where its tracking error is `worse` times
    what it was over as long before. Where what was gathered does not suffice, an experiment of about `experiment_s` is
    driven that leads up to `experiment_mm` (0: none is) to either side of where the reference rests, its own strokes at
    about `experiment_mm_s`.
    """

    gathered_s: float = limited(75.0, 10.0, 240.0)
    held_out_share: float = limited(0.2, 0.1, 0.5)
    answer_s: float = limited(60.0, 1.0)
    trial_s: float = limited(60.0, 5.0, 600.0)
    worse: float = limited(1.0, 0.5, 2.0)
    experiment_mm: float = limited(0.0, 0.0, 50.0)
    experiment_mm_s: float = limited(2.0, 0.1, 50.0)
    experiment_s: float = limited(20.0, 4.0, 60.0)
