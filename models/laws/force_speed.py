"""Force against speed: environmental resistance, mucus drag and Coulomb part of a steadily sliding capsule (paper V Eq.
1).
"""

import math
from dataclasses import dataclass
from typing import Any

from models.laws.geometry import GRAVITY, Capsule, Tissue
from models.laws.mucus import mucus_drag
from models.laws.resistance import pressure_integrals


@dataclass(frozen=True)
class Resistance:
    """The three parts of the force on a sliding capsule in N, each a number, an array over speed or a CasADi
    expression.
    """

    environmental: Any
    viscous: Any
    coulomb: Any

    @property
    def total(self) -> Any:
        """`F = F_e + F_v + F_c` in N."""
        return self.environmental + self.viscous + self.coulomb


def sliding_resistance(speed: Any, capsule: Capsule, tissue: Tissue) -> Resistance:
    """`F(v) = F_e(v) + F_v(v) + F_c(v)`, `F_e = sin(theta) I1`, `F_c = mu (m g + cos(theta) I1 + I2)`, `F_v` the mucus
    drag.

    `speed` v > 0 in m/s, any shape; forces in N. At 10 mm/s the paper's 50.1 g capsule gives 66.37 + 2.55 + 78.78 =
    147.7 mN. The tissue's `regime` "blend" passes smoothly from the low-speed to the high-speed moduli about
    20 mm/s, where the paper's Fig. 7 jumps. Source: paper V Eq. 1, 8, 9, 11, 12.
    """
    nose, cylinder = pressure_integrals(speed, capsule, tissue)
    load = capsule.mass_kg * GRAVITY + math.cos(tissue.theta) * nose + cylinder
    drag = mucus_drag(speed, tissue.mucus_thickness_m)
    return Resistance(math.sin(tissue.theta) * nose, drag, tissue.friction_coefficient * load)
