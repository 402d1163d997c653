"""A drive that is a force and nothing else, for closed forms and drives to come."""

from dataclasses import dataclass
from typing import ClassVar

from plant import steps
from plant.drives import TrueDrive
from plant.hidden.registry import FORCE


@dataclass(frozen=True)
class Force(TrueDrive):
    """A force in N on the body, nothing else."""

    kind: ClassVar[str] = FORCE
    step: ClassVar[int] = steps.FORCE
