"""What a worker of a campaign does: runs, each of which ends in a row, whatever happens in it; a closed loop is one."""

import contextlib
import io
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, Final, Protocol

from controller.model.control_model import ControlModel
from hil.app.scenario.bus_scenario import SilScenario, parse_sil_scenario
from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.sil.sil import judged
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import document, score
from hil.app.write import file_trouble
from models.theta import Theta
from models.workers import end_with_parent

TRIES: Final = 3  # workers that a run may cost
Row = dict[str, Any]
Table = Mapping[str, Any]
_MODELS: dict[Any, ControlModel] = {}
_MOST_MODELS = 8  # that are kept


class Job(Protocol):
    """One run of a campaign: its name in the results, its seed, and what distinguishes it (`point`)."""

    @property
    def number(self) -> int | str: ...
    @property
    def seed(self) -> int: ...
    @property
    def point(self) -> Mapping[str, Any]: ...

    def result(self) -> Row:
        """Its result as JSON. Raises ValueError where it cannot be done."""
        ...


@dataclass(frozen=True)
class Loop:
    """A run of a closed loop: its number, the scenario as tables, its seed, what distinguishes it (`point`), and the
    stage and values of the controller's model.
    """

    number: int
    engine: str
    raw: Table
    seed: int
    point: Table
    values: Theta
    stage: str

    def result(self) -> dict[str, Any]:
        """What the engine prints with --json. Raises ValueError for a scenario that cannot be run."""
        if self.engine == "sil":
            over_bus = parse_sil_scenario(self.raw)
            return judged(over_bus, _model(over_bus, self.values), None, self.seed, self.stage)[0]
        scenario = parse_track_scenario(self.raw)
        name = scenario.control.controller
        trace = run_loop(scenario, _model(scenario, self.values), name, self.seed)
        return document(scenario, name, self.seed, self.stage, score(scenario, trace))


def _model(scenario: TrackScenario | SilScenario, values: Theta) -> ControlModel:
    """The control model; runs of one belief, tick and learned values share it."""
    loop = scenario.loop if isinstance(scenario, SilScenario) else scenario
    key = (type(scenario), repr(loop.belief), loop.control.tick_s, tuple(sorted(values.spelled().items())))
    if key not in _MODELS:
        if len(_MODELS) >= _MOST_MODELS:
            del _MODELS[next(iter(_MODELS))]
        if isinstance(scenario, SilScenario):
            _MODELS[key] = believed_on_bus(scenario, values)
        else:
            _MODELS[key] = believed_model(scenario, values)
    return _MODELS[key]


def run_jobs(jobs: Sequence[Job]) -> list[Row]:
    """A chunk of runs, one row each: number, seed, point, and the result or an error in words."""
    return [run_job(job) for job in jobs]


def run_job(job: Job) -> Row:
    """One run. One that cannot be done gives a row with `error`."""
    row = _row(job)
    began = time.perf_counter()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            row["result"] = job.result()
    except Exception as error:  # noqa: BLE001 - one run that fails is a result of the campaign, not its end
        words = file_trouble(error) if isinstance(error, OSError) else " ".join(str(error).split())[:300]
        row["error"] = words if isinstance(error, OSError | ValueError) else f"{type(error).__name__}: {words}"
    row["seconds"] = round(time.perf_counter() - began, 3)
    return row


def pooled(parts: Sequence[Sequence[Job]], workers: int) -> Iterator[list[Row]]:
    """The rows of each chunk as it ends, computed by `workers` processes. The runs of chunks that were under way when a
    worker died are done again at the end, one at a time; one that kills `TRIES` workers becomes a row with `error`.
    """
    waiting, suspects = deque(parts), deque[Job]()
    while waiting:
        flying: dict[Future[list[Row]], Sequence[Job]] = {}
        with _pool(workers) as pool, contextlib.suppress(BrokenProcessPool):
            while waiting or flying:
                while waiting and len(flying) <= workers:
                    flying[pool.submit(run_jobs, waiting[0])] = waiting[0]
                    waiting.popleft()
                for future in wait(flying, return_when=FIRST_COMPLETED).done:
                    yield future.result()
                    del flying[future]
        suspects.extend(job for part in flying.values() for job in part)
    deaths = 0
    while suspects:
        with _pool(1) as pool, contextlib.suppress(BrokenProcessPool):
            while suspects:
                yield pool.submit(run_jobs, [suspects[0]]).result()
                suspects.popleft()
                deaths = 0
        deaths += 1
        if suspects and deaths == TRIES:
            yield [lost(suspects.popleft(), TRIES)]
            deaths = 0


@contextlib.contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with this one, and are not waited for where it is interrupted."""
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=end_with_parent) as pool:
        try:
            yield pool
        except (KeyboardInterrupt, GeneratorExit):
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def lost(job: Job, deaths: int) -> Row:
    """The row of a run that has killed so many workers."""
    return _row(job) | {"error": f"its worker died {deaths} times", "seconds": 0.0}


def _row(job: Job) -> Row:
    return {"run": job.number, "seed": job.seed, "point": dict(job.point)}
