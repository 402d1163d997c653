"""Hyperelastic intestine wall, lengthwise and around (paper A Eq. 1-3, after Ciarletta 2009)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from models.parameter import load_set


@dataclass(frozen=True)
class WallConstants:
    """Constants of the hyperelastic wall: stresses in Pa, the exponents k2* dimensionless (A and C, Table 1)."""

    c1_Pa: float
    k1_coll_Pa: float
    k2_coll: float
    k1_cm_Pa: float
    k2_cm: float
    k1_lm_Pa: float
    k2_lm: float

    @classmethod
    def from_set(cls, name: str = "zhang2016_analytical") -> WallConstants:
        """Read the constants from a parameter set."""
        s = load_set(name)
        return cls(*(s[key] for key in cls.__dataclass_fields__))


def _stress(stretch: Any, invariant: Any, c1: float, collagen: Any, k2: float, k1_muscle: float, k2_muscle: float) -> Any:
    strain = stretch**2 - 1
    return c1 * (1 - stretch**-4) + collagen * (invariant - 1) * np.exp(k2 * (invariant - 1) ** 2) + k1_muscle * strain * np.exp(k2_muscle * strain**2)


def longitudinal_stress(stretch: Any, wall: WallConstants) -> Any:
    """Stress along the gut, `H_l(l) = c1 (1 - l^-4) + (3 l^4 - 1)/(2 l^4) k1 (I - 1) exp(k2 (I - 1)^2) + kLM1 (l^2 - 1) exp(kLM2 (l^2 - 1)^2)`.

    `I = (3 l^4 + 1)/(4 l^2)`. `stretch` l is dimensionless, any shape; the stress is in Pa, same shape. Valid for stretches of
    about 1 to 1.6, the range of Ciarletta's tests. Source: paper A Eq. 1 and 3 (Eq. 18-20 of A do *not* follow from it).
    """
    invariant = (3 * stretch**4 + 1) / (4 * stretch**2)
    collagen = (3 * stretch**4 - 1) / (2 * stretch**4) * wall.k1_coll_Pa
    return _stress(stretch, invariant, wall.c1_Pa, collagen, wall.k2_coll, wall.k1_lm_Pa, wall.k2_lm)


def circumferential_stress(stretch: Any, wall: WallConstants) -> Any:
    """Stress around the gut, `H_c`, as `longitudinal_stress` with `I = (l^4 + 3)/(4 l^2)`, factor `(l^4 - 3)/(2 l^4)` and the
    circular muscle's constants. Source: paper A Eq. 2 and 3.
    """
    invariant = (stretch**4 + 3) / (4 * stretch**2)
    collagen = (stretch**4 - 3) / (2 * stretch**4) * wall.k1_coll_Pa
    return _stress(stretch, invariant, wall.c1_Pa, collagen, wall.k2_coll, wall.k1_cm_Pa, wall.k2_cm)
