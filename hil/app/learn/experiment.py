"""The experiment that is driven where what was gathered does not suffice."""

from typing import Final

import numpy as np

from controller.reference import Experiment
from hil.app.scenario.deployment import Pace
from models.identification.finding import Proposal

STROKES: Final = ((1.0, 1.0), (-1.0, 0.5), (0.5, 2.0), (-0.5, 2.0), (0.5, 0.5), (0.0, 1.0))
"""Shares of the reach to go to one after the other, and of the speed to go there with, each followed by a rest."""
REST_S: Final = 0.5  # after each motion
MM: Final = 1e-3  # in metres
_LEAST_S: Final = 0.1  # of a motion

Motion = tuple[tuple[float, ...], tuple[float, ...]]
"""Times in s and places in m from 0 on."""


def motion_of(proposal: Proposal | None) -> Motion:
    """The motion that a search proposes to tell effects apart, from 0 on; two empty tuples where it proposes none."""
    if proposal is None or not proposal.separations:
        return (), ()
    times, places = proposal.times_s - proposal.times_s[0], proposal.places_m - proposal.places_m[0]
    return tuple(times.tolist()), tuple(places.tolist())


def experiment_of(motion: Motion, pace: Pace, at_s: float) -> Experiment | None:
    """As much of `motion` as `pace` allows, or strokes where there is none; None where it allows nothing."""
    reach, speed = MM * pace.experiment_mm, MM * pace.experiment_mm_s
    if not reach:
        return None
    if any(motion[1]):
        times, places = (np.array(values) for values in motion)
        end = min(float(times[-1]), pace.experiment_s)
        at = np.append(times[times < end], end)
        wanted = np.interp(at, times, places)
        wanted *= min(1.0, reach / float(np.max(np.abs(wanted), initial=1e-12)))
        steps = [(float(t), float(x)) for t, x in zip(at, wanted, strict=True)]
    else:
        steps, here, now = [(0.0, 0.0)], 0.0, 0.0
        for share, faster in STROKES:
            place = share * reach
            now += max(abs(place - here) / (faster * speed), _LEAST_S)
            steps += [(now, place), (now + REST_S, place)]
            here, now = place, now + REST_S
            if now > pace.experiment_s:
                break
    end, last = steps[-1]
    if last:
        steps.append((end + max(abs(last) / speed, _LEAST_S), 0.0))
    times_s, places_m = zip(*steps, strict=True)
    return Experiment(tuple(times_s), tuple(places_m), at_s)
