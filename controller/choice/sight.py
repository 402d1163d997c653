"""Which localisation is too slow or too late for a controller to lead."""

from collections import Counter
from dataclasses import replace
from typing import Final

import numpy as np

from controller.choice.trial import Mission, ended, loop_in
from controller.choice.world import Localisation, Push
from controller.drives import envelope_of
from controller.model.control_model import ControlModel
from controller.supervision.contradiction import CONFIRMED
from controller.supervision.fallback import not_led
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
TUNED: Final = Localisation()
"""The localisation that the controllers are tuned with."""
TRIALS: Final = 3
"""Trials, each with a noise of its own: of the controllers at their limit some runs fail and some do not."""
LONGEST_S: Final = 60.0
"""Length of a mission that is simulated."""
LEADS: Final = 0.9
"""Share of the ticks, from the first that is led, that a controller must lead."""
_GRID_S: Final = 0.01


def unfit(mission: Mission, model: ControlModel, controller: str, loops: bool = True) -> str:
    """Why `controller` must not lead `mission` with its localisation, "" if it may. Without `loops` nothing is run.

    - Age: a reading is up to `1/rate + latency` old before the next one; the drive stops at `limits.age_s`.
    - Way: that a capsule leaves the envelope shows in `CONFIRMED` readings. The reference must stay within the envelope
      meanwhile: `speed (CONFIRMED/rate + latency) <= envelope`.
    - Loop: with a localisation slower or later than it is tuned with, a controller must follow the mission on the
      model to its end, `TRIALS` times. Where it fails with that of `TUNED` too, the localisation is not to blame.
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
    good = replace(seen, rate_Hz=max(seen.rate_Hz, TUNED.rate_Hz), latency_s=min(seen.latency_s, TUNED.latency_s))
    for seed in range(TRIALS) if loops and good != seen else ():
        why = _ends(mission, model, controller, seed)
        if why and not _ends(replace(mission, seen=good), model, controller, seed):
            return TEXT("sight.loop", why=why, **stated)
    return ""


def _ends(mission: Mission, model: ControlModel, controller: str, seed: int) -> str:
    """What ends the loop of `controller` on its own model, or that it does not lead there; "" where it follows the
    mission to its end.
    """
    loop, capsule = loop_in((model, Push()), mission, model, controller, seed=seed)
    ticks, led = round(min(mission.duration_s, LONGEST_S) / model.tick_s), Counter[str]()
    for tick in loop.run(capsule, ticks):
        if why := ended(loop, capsule):
            return why
        if led or tick.active != "stop":  # the estimate has begun
            led[tick.active] += 1
    return not_led(led, controller, LEADS)
