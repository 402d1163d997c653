"""Fences of a carriage and a coil, and evidence on which both may move, that tests of the guard share."""

from hil.nodes.frame_map import ENABLED
from hil.nodes.guard import Evidence, Fence
from tests.hil.ticks import TICK

CARRIAGE = Fence(-1.0, 1.0, 0.25, True, TICK, 0.02, 25.0)
COIL = Fence(-0.8, 0.8, 100.0, False, TICK, 0.01)
GOOD = Evidence(0.012, 0.003, ENABLED)
