"""An axis under feedback: its force holds the noise of its place; the intervals must hold the truth all the same."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from models.effects.effect import Effect, Signals, Value, Values, number
from models.effects.own import Origin
from models.identification import close
from models.identification.kinds import kind_for, ready
from models.identification.kinds.axis.driven import NoisyAxisKind
from models.records.record import record_of
from models.rigs.reader import parse_rig

TRUTH = {"mass_kg": 2.0, "viscous_friction_N_s_per_m": 6.0, "coulomb_friction_N": 1.5, "offset_N": 0.4}
STEP_S, SUBSTEPS, SECONDS = 2e-3, 10, 16.0
SEEDS, LEAST = 20, 18


def loop(seed: int, noise_m: float) -> dict[str, Any]:
    """A PD loop along two swings, on a place with noise; the force holds over a sample, friction is settled in steps of
    0.2 ms.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0, SECONDS, STEP_S)
    slow, fast = rng.uniform(0.25, 0.35), rng.uniform(0.7, 0.9)
    reference = 0.06 * np.sin(2 * np.pi * slow * t) + 0.02 * np.sin(2 * np.pi * fast * t)
    mass, viscous, coulomb, offset = TRUTH.values()
    h = STEP_S / SUBSTEPS
    seen, force = np.empty(t.size), np.empty(t.size)
    x = v = 0.0
    for k, goal in enumerate(reference):
        seen[k] = x + noise_m * rng.standard_normal()
        force[k] = 300.0 * (goal - seen[k]) - 20.0 * (seen[k] - seen[k - 1]) / STEP_S * (k > 0)
        for _ in range(SUBSTEPS):
            free = v + h / mass * (force[k] - offset - viscous * v)
            v = np.sign(free) * max(abs(free) - h / mass * coulomb, 0.0)
            x += h * v
    return {"t_s": t, "position_m": seen, "force_N": force}


@pytest.mark.parametrize("driven", [{"driven": "force_N"}, {}], ids=["force in", "place in"])
def test_feedback_does_not_bias_an_axis_beyond_its_intervals(driven: dict[str, str]) -> None:
    rig = parse_rig({"rig": {"kind": "axis", **driven}, "noise": {"force_scale_std": 0.0}})
    held, widths = dict.fromkeys(TRUTH, 0), list[float]()
    for seed in range(SEEDS):
        record = record_of("loop", loop(seed, 2e-4), rig)
        finding, _ = close(rig, [record], [], lambda *_: None, seed=seed, most=0)
        for name, truth in TRUTH.items():
            low, high = finding.calibration[name].ci95
            held[name] += low <= truth <= high
            widths.append((high - low) / truth)
    assert float(np.median(widths)) < 0.1
    assert min(held.values()) >= LEAST, held


class Bend(Effect):
    """A force that grows as the cube of the place."""

    id = "bend"
    kinds = frozenset({"axis"})
    probe = 1.0
    stiffness_N_per_m3 = number(0.0, "N/m3", -1e6, 1e6)

    def force(self, s: Signals, p: Values, z: Values) -> Value:
        return -p["stiffness_N_per_m3"] * s.x**3


def test_an_effect_from_outside_runs_where_the_place_is_too_noisy() -> None:
    """As the spline inside the simulation does: it was looked up in the project's catalogue alone."""
    rig = parse_rig({"rig": {"kind": "axis"}})
    record = ready(record_of("loop", loop(1, 2e-4), rig), rig)
    kind = kind_for(rig, [record])
    assert isinstance(kind, NoisyAxisKind)
    own = replace(kind.catalogue, own=(Origin(Bend, "", "bend"),))
    wide = replace(kind, effects=(*kind.effects, Bend), catalogue=own)
    plain = wide.residual(record, kind.nominal())
    bent = wide.residual(record, kind.nominal().with_("bend", {"stiffness_N_per_m3": 1e6}))
    assert float(np.max(np.abs(bent - plain))) > 1
