"""What the node sees of a sound rig while its own ticks are held up."""

import numpy as np

from controller.limits import Envelope, Limits
from controller.signals import Measurement
from controller.supervision.breakaway import Resistance
from controller.supervision.probe import Probe
from hil.nodes.node import Shifted
from hil.nodes.plausibility import Onlooker

TICK_S = 1e-3
MAGNET = Envelope(-1.0, 1.0, Limits(), 0.25, 10.0, 0.011, placed=True)


def probed(seed: int) -> str:
    """What the probe says where ticks are skipped for up to 0.4 s at random; the readings of a gap arrive after it."""
    probe, rng = Probe(MAGNET), np.random.default_rng(seed)
    reference, onlooker = Shifted(probe.path, 0.0, 0.0), Onlooker(MAGNET, 1e-4, TICK_S, 1e-4, Resistance())
    waiting: list[Measurement] = []
    goes_on_s = 0.0
    for t in np.arange(0.0, probe.path.end_s, TICK_S).tolist():
        here = np.array([t])
        place, way = float(reference.position(here)[0]), float(np.sign(reference.speed(here)[0]))
        if round(t / TICK_S) % 10 == 0:
            waiting.append(Measurement("position_m", place + 1e-4 * rng.standard_normal(), t))
        if t >= goes_on_s:
            assert onlooker.look(t, place + 3e-3 * way, place, waiting, 0.0, reference, probe) == ""
            waiting.clear()
            goes_on_s = t + rng.uniform(0.02, 0.4) * (rng.random() < 0.004)
    return probe.reason()


def test_a_sound_rig_passes_the_probe_of_a_node_that_is_held_up() -> None:
    assert [probed(seed) for seed in range(20)] == [""] * 20
