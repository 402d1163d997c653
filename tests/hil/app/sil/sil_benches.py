"""Benches of a run over the bus that a test takes on tick by tick."""

from collections.abc import Mapping
from typing import Any

from controller.signals import Action
from hil.app.sil.testbed import Bench
from tests.hil.app.sil.sil_runs import model_of, scenario_of


def bench_of(kind: str = "magnetic", *faults: Mapping[str, Any]) -> Bench:
    """A bench whose controller has not been started. What cannot be true stops nothing: `Full` runs away from every
    reference.
    """
    bench = Bench(scenario_of(kind, 5.0, *faults), model_of(kind), "vibro" if kind == "vibro" else "feedforward", 1)
    bench.node.answer.look = lambda *_: ""  # type: ignore[method-assign]
    return bench


def go(bench: Bench, seconds: float) -> None:
    """Some ticks."""
    for _ in range(round(seconds / bench.tick_s)):
        bench.begin_tick()
        pause(bench, 1)


def pause(bench: Bench, ticks: int) -> None:
    """Let time go on without the controller."""
    for _ in range(ticks):
        for number in range(bench.slots):
            bench.slot(number)
        bench.end_tick()


class Full:
    """A controller that asks for all there is, one `way` or the other."""

    active = "full"
    temperature_C = 20.0

    def __init__(self, way: float = 1.0) -> None:
        self.way = way

    def reset(self, *_: object) -> None:
        """Nothing to remember."""

    def act(self, *_: object) -> Action:
        """More than any range allows."""
        return Action(9.0 * self.way)
