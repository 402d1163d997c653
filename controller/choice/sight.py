"""Which localisation is too slow or too late for a controller to lead."""

from dataclasses import replace
from typing import Final

import numpy as np

from controller.choice.trial import Mission, ended, loop_in
from controller.choice.world import Localisation, Push
from controller.drives import envelope_of
from controller.model.control_model import ControlModel
from controller.registry import MODEL_FREE
from controller.supervision.contradiction import CONFIRMED
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
TUNED: Final = Localisation()
"""The localisation that the model-free controllers are tuned with."""
LONGEST_S: Final = 60.0
"""Length of a mission that is simulated."""
_GRID_S: Final = 0.01


def unfit(mission: Mission, model: ControlModel, controller: str) -> str:
    """Why `controller` must not lead `mission` with its localisation, "" if it may.

    - Age: a reading is up to `1/rate + latency` old before the next one; the drive stops at `limits.age_s`.
    - Way: that a capsule leaves the envelope shows in `CONFIRMED` readings. The reference must stay within the envelope
      meanwhile: `speed (CONFIRMED/rate + latency) <= envelope`.
    - Loop: nothing but a model carries the estimate across the delay. A controller without one, with a localisation
      slower or later than it is tuned with, must follow the mission on the model, without swinging or a stop, with
      readings later by one that is missed.
    """
    seen, limits = mission.seen, mission.limits
    stated = {"rate_Hz": seen.rate_Hz, "late_ms": 1e3 * seen.latency_s, "controller": controller}
    old_s = 1 / seen.rate_Hz + seen.latency_s
    if old_s + model.tick_s > limits.age_s:
        return TEXT("sight.old", old_s=old_s, age_s=limits.age_s, **stated)
    around_m = envelope_of(model.drive, limits).around_m
    times = np.arange(0.0, mission.duration_s, _GRID_S)
    fastest = float(np.max(np.abs(mission.reference.speed(times)), initial=0.0))
    way_m = fastest * (CONFIRMED / seen.rate_Hz + seen.latency_s)
    if way_m > around_m:
        most = around_m / (CONFIRMED / seen.rate_Hz + seen.latency_s)
        return TEXT("sight.way", speed_mm_s=1e3 * fastest, most_mm_s=1e3 * most, **stated)
    slower = seen.rate_Hz < TUNED.rate_Hz or seen.latency_s > TUNED.latency_s
    if controller in MODEL_FREE and slower and (why := _ends(mission, model, controller)):
        return TEXT("sight.loop", why=why, **stated)
    return ""


def _ends(mission: Mission, model: ControlModel, controller: str) -> str:
    """What ends the loop of `controller` on its own model, "" where nothing does within the mission."""
    seen = replace(mission.seen, latency_s=mission.seen.latency_s + 1 / mission.seen.rate_Hz)
    loop, capsule = loop_in((model, Push()), replace(mission, seen=seen), model, controller)
    ticks = round(min(mission.duration_s, LONGEST_S) / model.tick_s)
    return next((why for _ in loop.run(capsule, ticks) if (why := ended(loop, capsule))), "")
