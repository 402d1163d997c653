"""Drag of the shear-thinning mucus film between capsule and wall (paper V Eq. 9, 10)."""

from typing import Any

import numpy as np

from models.parameter import load_set

_MM = 1e3  # the empirical equation counts in mm and mm/s


def mucus_drag(slip_speed: Any, film_m: float) -> Any:
    """`F_v = delta(w) w`, `delta = 0.1148 + 11.24 (w/h)^-0.7552` in N s/m with w in mm/s and film h in mm; odd in w, 0
    at rest.

    `slip_speed` w in m/s, any shape, `film_m` h in m; the drag is in N, same shape. Only this reading of the garbled
    Eq. 10 gives the 0.73 mN at 0.5 mm/s that paper A quotes (0.74 mN). Source: paper V Eq. 9, 10, after Wu 2000.
    """
    s = load_set("wu2000_mucus")
    w, h = np.abs(slip_speed) * _MM, film_m * _MM
    drag = s["floor_N_s_per_m"] * w + s["scale_N_s_per_m"] * h * (w / h) ** (1 + s["exponent"])
    return np.sign(slip_speed) * drag / _MM
