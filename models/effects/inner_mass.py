"""Effects that act between a body and its inner mass: what they look at and what they add."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from models.effects.effect import Effect, Values


@dataclass(frozen=True)
class InnerMassEffect(Effect):
    """An effect of the vibro drive's suspension or coil; its hooks see how far (m) and how fast (m/s) the inner mass moves
    against the body."""

    def suspension(self, stretch: Any, rate: Any, p: Values) -> Any:
        """Extra force in N that pulls the inner mass back to the body (and the body after it)."""
        return 0.0

    def reach(self, stretch: Any, p: Values) -> Any:
        """Factor on the coil's force."""
        return 1.0
