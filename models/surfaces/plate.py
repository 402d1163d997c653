"""A rigid plate under the body: Coulomb friction and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

from models.parameter import Parameter


@dataclass(frozen=True)
class Plate:
    """A body of `mass_kg` (without an inner mass) on a plate: it rests while the other forces stay within `mu m g`."""

    mass_kg: float
    friction_coefficient: float = 0.29

    def parameters(self) -> tuple[Parameter, ...]:
        """What calibration may fit of the plate."""
        mu = self.friction_coefficient
        return (Parameter("friction_coefficient", mu, "1", 0.5 * mu, 2.0 * mu, "rig file", fit=True),)
