"""Drag of the shear-thinning mucus film between capsule and wall (paper V Eq. 9, 10)."""

from __future__ import annotations

from typing import Any

import numpy as np

_COEFFICIENT, _EXPONENT, _FLOOR = 11.24, -0.7552, 0.1148  # mN s/mm with speeds in mm/s and the film in mm
_MM = 1e3


def mucus_drag(slip_speed: Any, film_m: float) -> Any:
    """`F_v = delta(w) w`, `delta = 0.1148 + 11.24 (w/h)^-0.7552` mN s/mm with w in mm/s and film h in mm; odd in w.

    `slip_speed` w in m/s, any shape, `film_m` h in m; the drag is in N. Only this reading of the garbled Eq. 10 gives the
    0.73 mN at 0.5 mm/s that paper A quotes (0.74 mN). Source: paper V Eq. 9, 10, after Wu 2000.
    """
    w = np.abs(slip_speed) * _MM
    h = film_m * _MM
    drag = _FLOOR * w + _COEFFICIENT * h * (w / h) ** (1 + _EXPONENT)
    return np.sign(slip_speed) * drag / _MM
