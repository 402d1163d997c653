"""Mean speeds of a body with an inner mass on a plate, for a table of periods and duties."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.identification.kinds.vibro_table.numbers import VibroCycle
from models.identification.kinds.vibro_table.solver import table

Array = NDArray[np.float64]
STEP_S = 2.0e-3  # longest step of a run's integration; the solver goes finer by itself


def mean_velocities(
    period_s: Any, duty: Any, cycles: Any, q: VibroCycle, settle: int = 0, step: float = STEP_S
) -> Array:
    """Mean speeds in m/s, one a condition, of a body started from rest; arrays of one length n, SI.

    `M v' = S(xi, xi') - r F + incline - Coulomb - drag`, `m (v' + xi'') = F - S`, with the suspension's force S, the
    coil's F and r = 1 where the coil sits on the body; Coulomb friction is set-valued (the body rests while the other
    forces stay within it). Structure as in Liu, Pavlovskaia and Wiercigroch. Raises ValueError for periods not above 0,
    duties outside [0, 1] or cycles below 1.
    """
    period, share, count = np.broadcast_arrays(*(np.asarray(a, dtype=float) for a in (period_s, duty, cycles)))
    if not np.all(period > 0):
        raise ValueError(f"period_s must be above 0; got {float(np.min(period)):g}")
    if not np.all((share >= 0) & (share <= 1)):
        raise ValueError(f"duty must lie in [0, 1]; got {float(share[(share < 0) | (share > 1)][0]):g}")
    if not np.all(count >= 1):
        raise ValueError(f"cycles must be at least 1; got {float(np.min(count)):g}")
    p, d, c = (np.ascontiguousarray(a, dtype=float).ravel() for a in (period, share, count))
    speeds: Array = table(p, d, c, settle, step, q)
    return speeds.reshape(period.shape)
