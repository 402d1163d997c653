"""What a worker of a campaign does: runs, each of which ends in a row, whatever happens in it; a closed loop is one."""

import contextlib
import io
import os
import socket
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import active_children, get_context
from typing import Any, Final, Protocol

from controller.model.control_model import ControlModel
from hil.app.campaign.series_answers import OUTSIDE, TEXT
from hil.app.cluster import program_version
from hil.app.console import note, printable
from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.sil.sil import judged
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import document, score
from hil.app.write import file_trouble
from models.theta import Theta
from models.workers import end_with_parent

TRIES: Final = 3  # workers that a run may cost
PASSING: Final = ("files", "worker")  # what a row has until it is on file
LONGEST_S: Final = 1e6  # that a run may be allowed to last
_STARTS_S: Final = 60.0  # longest start of a worker
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
        """Its result as JSON, with `files` as texts by name where it makes any. Raises ValueError where it cannot be
        done, OSError for a cause outside it.
        """
        ...


@dataclass(frozen=True)
class Loop:
    """A closed loop: number, scenario as tables, seed, what distinguishes it (`point`), values, stage."""

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
            model = _model(over_bus.loop, self.values, "sil", lambda: believed_on_bus(over_bus, self.values))
            return judged(over_bus, model, None, self.seed, self.stage)[0]
        scenario = parse_track_scenario(self.raw)
        name = scenario.control.controller
        model = _model(scenario, self.values, "track", lambda: believed_model(scenario, self.values))
        trace = run_loop(scenario, model, name, self.seed)
        return document(scenario, name, self.seed, self.stage, score(scenario, trace))


def _model(loop: TrackScenario, values: Theta, engine: str, build: Callable[[], ControlModel]) -> ControlModel:
    """The control model; runs of one belief, tick and learned values share it."""
    key = (engine, repr(loop.belief), loop.control.tick_s, tuple(sorted(values.spelled().items())))
    if key not in _MODELS:
        if len(_MODELS) >= _MOST_MODELS:
            del _MODELS[next(iter(_MODELS))]
        _MODELS[key] = build()
    return _MODELS[key]


def run_jobs(jobs: Sequence[Job]) -> list[Row]:
    """A chunk of runs, one row each: number, seed, point, and the result or an error in words."""
    return [run_job(job) for job in jobs]


def run_job(job: Job) -> Row:
    """One run. One that cannot be done gives a row with `error`, and with `cause` where that lies outside the run."""
    row = _row(job)
    began = time.perf_counter()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            row["result"] = job.result()
            row["files"] = row["result"].pop("files", {})
    except Exception as error:  # noqa: BLE001 - one run that fails is a result of the campaign, not its end
        words = file_trouble(error) if isinstance(error, OSError) else str(error)
        words = printable(" ".join(words.split())[:300])
        row["error"] = words if isinstance(error, OSError | ValueError) else f"{type(error).__name__}: {words}"
        row |= {"cause": OUTSIDE} if _from_outside(error) else {}
    row["seconds"] = round(time.perf_counter() - began, 3)
    return row


def _from_outside(error: BaseException | None) -> bool:
    """Whether the system refused something, then or before the error was put in words."""
    if error is None:
        return False
    # one without a number, as of a bad archive, lies in the file
    refused = isinstance(error, MemoryError | ImportError) or (isinstance(error, OSError) and bool(error.errno))
    return refused or _from_outside(error.__context__)


def pooled(parts: Iterable[Sequence[Job]], workers: int, limit_s: float = LONGEST_S) -> Iterator[list[Row]]:
    """The rows of each chunk as it ends, computed by `workers` processes; workers that are silent for longer than
    `limit_s` a run are killed. The runs of chunks that were under way when a worker died are done again at the end, one
    at a time: one that kills `TRIES` workers, or is silent again, becomes a row with `error`.
    """
    waiting, suspects, more = iter(parts), deque[Job](), True
    while more:
        flying: dict[Future[list[Row]], tuple[float, Sequence[Job]]] = {}
        with _pool(workers) as pool, contextlib.suppress(BrokenProcessPool):
            while more or flying:
                while more and len(flying) < workers:
                    if (part := next(waiting, None)) is None:
                        more = False
                        break
                    suspects.extend(part)
                    flying[pool.submit(run_jobs, part)] = time.monotonic() + _STARTS_S + limit_s * len(part), part
                    for _ in part:
                        suspects.pop()
                ended = _ended(flying) if flying else set()
                if not ended:
                    break
                for future in ended:
                    yield future.result()
                    del flying[future]
        suspects.extend(job for _, part in flying.values() for job in part)
    for job in suspects:
        yield [_alone(job, limit_s)]


def _alone(job: Job, limit_s: float) -> Row:
    """The row of a run whose worker has died, done by a worker of its own."""
    for _ in range(TRIES):
        with _pool(1) as pool, contextlib.suppress(BrokenProcessPool):
            future, ends = pool.submit(run_jobs, [job]), time.monotonic() + _STARTS_S + limit_s
            if _ended({future: (ends, [job])}):
                return future.result()[0]
            return overdue(job, limit_s)
    return lost(job, TRIES)


def _ended(flying: Mapping[Future[list[Row]], tuple[float, Sequence[Job]]]) -> set[Future[list[Row]]]:
    """The chunks that end next. Where one has not ended by its time, all workers are killed, and none is returned."""
    left = min(ends for ends, _ in flying.values()) - time.monotonic()
    done = wait(flying, timeout=max(left, 0.0), return_when=FIRST_COMPLETED).done
    if not done:
        note(TEXT("silent"))
        for child in active_children():
            child.kill()
    return done


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
    return _row(job) | {"error": f"its worker died {deaths} times", "cause": OUTSIDE, "seconds": 0.0}


def overdue(job: Job, limit_s: float) -> Row:
    return _row(job) | {"error": f"it took longer than its limit of {limit_s:g} s", "seconds": limit_s}


def _row(job: Job) -> Row:
    """What all rows have; `worker` is not kept."""
    place = f"{socket.gethostname()} {os.getpid()}"
    return {"run": job.number, "seed": job.seed, "point": dict(job.point)} | {
        "version": program_version(),
        "worker": place,
    }
