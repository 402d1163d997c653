"""An elastic link that pulls a body: a string, a thread or a stem between a rig and its capsule."""

from dataclasses import dataclass
from typing import Any

import numpy as np

_STIFFEST = 1e-7  # m/N, compliance below which a link counts as rigid
_STEEPEST = 12.0  # argument of the hyperbolic functions beyond which the link hardens no more


@dataclass(frozen=True)
class Link:
    """Force `sinh(b e)/(b c) + d e'` in N at the stretch e in m: compliance `c` in m/N, `hardening` b in 1/m (0:
    linear), `damping` d in N s/m. Exponential hardening is what fibres and threads show.
    """

    compliance: Any
    hardening: Any
    damping: Any

    def force(self, stretch: Any) -> Any:
        """Elastic force in N."""
        return np.sinh(self._argument(stretch)) / (self._b * self._c)

    def stiffness(self, stretch: Any) -> Any:
        """Slope of the elastic force in N/m."""
        return np.cosh(self._argument(stretch)) / self._c

    def _argument(self, stretch: Any) -> Any:
        return np.fmax(np.fmin(self._b * stretch, _STEEPEST), -_STEEPEST)

    @property
    def _c(self) -> Any:
        return np.fmax(self.compliance, _STIFFEST)

    @property
    def _b(self) -> Any:
        return np.fmax(self.hardening, 1e-3)
