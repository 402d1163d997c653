"""What a drive is: how a command becomes motion or force, and what is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from models.parameter import Parameter


@dataclass(frozen=True)
class Drive:
    """A drive's beliefs. `imposed`: the command is the capsule's position, and the force on it is measured."""

    name: ClassVar[str] = ""
    commanded: ClassVar[str] = ""
    measured: ClassVar[str] = ""
    imposed: ClassVar[bool] = False

    def parameters(self) -> tuple[Parameter, ...]:
        """What calibration may fit of the drive."""
        return ()

    def force(self, x: Any, v: Any, command: Any, p: Mapping[str, Any]) -> Any:
        """Force on the capsule along +x in N."""
        return 0.0
