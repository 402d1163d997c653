"""Further models beside the one that leads: once that one is in doubt they predict the same readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from controller.monitor import Monitor
from controller.signals import Estimate, Measurement

if TYPE_CHECKING:
    from controller.supervision.model_switch import Prepared

MOST: Final = 4  # models beside the leading one
BETTER: Final = 3.0  # log likelihood ratio of the last seconds from which another model leads: 20 to 1


class Others:
    """The `prepared` models by name. They rest while the leading model holds. Once it is doubtful, each estimates and
    forecasts from the same readings, so a tick takes as much longer as it has estimators then.
    """

    def __init__(self, prepared: Mapping[str, Prepared]) -> None:
        """Raises ValueError for more than `MOST`."""
        if len(prepared) > MOST:
            raise ValueError(f"others must be {MOST} models or fewer; got {len(prepared)}")
        self._prepared = {name: one for name, one in prepared.items() if one.monitor is not None}
        self._running = False

    def observe(
        self, now: float, command: float, measurements: Sequence[Measurement], leading: Monitor
    ) -> tuple[str, Estimate] | None:
        """A tick beside the `leading` model: the name of the one to lead in its place, with its estimate."""
        state = leading.health.state
        if state == "holds" or not self._prepared:
            self._running = False
            return None
        found, most = None, BETTER
        for name, one in self._prepared.items():
            assert one.monitor is not None
            if not self._running:
                one.observer.reset(now, command)
                one.monitor.begin(now)
            estimate = one.observer.observe(now, command, measurements)
            one.monitor.look(now, command, estimate)
            better = leading.misfit - one.monitor.misfit
            if state == "broken" and not estimate.lost and better >= most:
                found, most = (name, estimate), better
        self._running = True
        return found

    def pop(self, name: str) -> Prepared:
        """The model `name`, which is no longer beside the leading one."""
        return self._prepared.pop(name)
