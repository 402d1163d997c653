"""Whether a rig has any hidden effect at all: without one, the compiled steps skip them."""

from __future__ import annotations

import numpy as np

from plant.compiling import compiled
from plant.tables import Floats


@compiled
def is_bare(h: Floats) -> bool:
    """True when every amplitude of the effect table `h` is zero."""
    return bool(np.all(h[:, 0] == 0.0))
