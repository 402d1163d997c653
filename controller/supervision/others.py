"""Further models beside the one that leads: once that one is in doubt they predict the same readings."""

from collections.abc import Mapping, Sequence
from typing import Final

from controller.estimator.base import Observer
from controller.monitor import Monitor
from controller.signals import Estimate, Measurement

MOST: Final = 4  # models beside the leading one
BETTER: Final = 3.0  # log likelihood ratio of the last seconds from which another model leads: 20 to 1


class Others:
    """Estimators and monitors of further models by name. They rest while the leading model holds. Once it is doubtful,
    each estimates and forecasts from the same readings: a tick then takes as much longer as it has estimators.
    """

    def __init__(self, watched: Mapping[str, tuple[Observer, Monitor]]) -> None:
        """Raises ValueError for more than `MOST`."""
        if len(watched) > MOST:
            raise ValueError(f"others must be {MOST} models or fewer; got {len(watched)}")
        self._watched, self._running = dict(watched), False

    def observe(
        self, now: float, command: float, measurements: Sequence[Measurement], leading: Monitor
    ) -> tuple[str, Estimate] | None:
        """A tick beside the `leading` model: the name of the one to lead in its place, with its estimate."""
        state = leading.health.state
        if state == "holds" or not self._watched:
            self._running = False
            return None
        found, most = None, BETTER
        for name, (estimator, monitor) in self._watched.items():
            if not self._running:
                estimator.reset(now, command)
                monitor.begin(now)
            estimate = estimator.observe(now, command, measurements)
            monitor.look(now, command, estimate)
            better = leading.misfit - monitor.misfit
            if state == "broken" and not estimate.lost and better >= most:
                found, most = (name, estimate), better
        self._running = True
        return found

    def drop(self, name: str) -> None:
        del self._watched[name]
