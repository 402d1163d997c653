"""What a worker of a campaign does: runs of closed loops, each of which ends in a row, whatever happens in it."""

from __future__ import annotations

import contextlib
import io
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from multiprocessing import get_context, parent_process
from os import _exit
from threading import Thread
from typing import Any, Final

from controller.model.control_model import ControlModel
from hil.app.campaign.file import Job
from hil.app.scenario.bus_scenario import SilScenario, parse_sil_scenario
from hil.app.scenario.scenario import TrackScenario, parse_track_scenario
from hil.app.sil.command import judged
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import document, score

TRIES: Final = 3
Row = dict[str, Any]


def run_jobs(jobs: Sequence[Job]) -> list[Row]:
    """A chunk of runs, one row each: number, seed, what sets it apart, and the result or an error in words."""
    return [run_job(job) for job in jobs]


def run_job(job: Job) -> Row:
    """One run. A scenario that cannot be run gives a row with `error`."""
    row: Row = {"run": job.number, "seed": job.seed, "point": dict(job.point)}
    began = time.perf_counter()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            row["result"] = _tracked(job) if job.engine == "track" else _over_the_bus(job)
    except Exception as error:  # noqa: BLE001 - one run that fails is a result of the campaign, not its end
        row["error"] = f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
    row["seconds"] = round(time.perf_counter() - began, 3)
    return row


def _tracked(job: Job) -> Row:
    scenario = parse_track_scenario(job.raw)
    name = scenario.control.controller
    trace = run_loop(scenario, _track_model(_Known(scenario, job.values)), name, job.seed)
    return document(scenario, scenario.name, name, job.seed, job.stage, score(scenario, trace), None)


def _over_the_bus(job: Job) -> Row:
    scenario = parse_sil_scenario(job.raw)
    found, _ = judged(scenario, _sil_model(_Known(scenario, job.values)), None, job.seed, job.stage)
    return found


class _Known:
    """A scenario by what its model depends on: belief, tick, learned values; so runs of one belief share a model."""

    def __init__(self, scenario: TrackScenario | SilScenario, values: Mapping[str, float]) -> None:
        loop = scenario.loop if isinstance(scenario, SilScenario) else scenario
        self.scenario, self.values = scenario, values
        self._key = (repr(loop.belief), loop.control.tick_s, tuple(sorted(values.items())))

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self._key == other._key


@lru_cache(maxsize=8)
def _track_model(known: _Known) -> ControlModel:
    assert isinstance(known.scenario, TrackScenario)
    return believed_model(known.scenario, known.values)


@lru_cache(maxsize=8)
def _sil_model(known: _Known) -> ControlModel:
    assert isinstance(known.scenario, SilScenario)
    return believed_on_bus(known.scenario, known.values)


def pooled(parts: Sequence[Sequence[Job]], workers: int) -> Iterator[list[Row]]:
    """The rows of each chunk as it ends, computed by `workers` processes. Chunks that were under way when a worker died
    are done again, one at a time; one that has cost `TRIES` pools is done run by run, and a run that still kills its
    worker becomes a row with `error`.
    """
    waiting = [(tuple(part), 0) for part in reversed(parts)]
    while waiting:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_end_with_parent) as pool:
            flying: dict[Future[list[Row]], tuple[tuple[Job, ...], int]] = {}
            try:
                while waiting or flying:
                    while (
                        waiting and len(flying) < workers + 1 and not (flying and (_suspect(flying) or waiting[-1][1]))
                    ):
                        part, tries = waiting.pop()
                        flying[pool.submit(run_jobs, part)] = part, tries
                    for future in wait(flying, return_when=FIRST_COMPLETED).done:
                        yield future.result()
                        del flying[future]
            except BrokenProcessPool:
                for part, tries in flying.values():
                    if tries + 1 < TRIES:
                        waiting.append((part, tries + 1))
                    elif len(part) > 1:
                        waiting += [((job,), 1) for job in part]
                    else:
                        yield [lost(part[0], TRIES)]
            except (KeyboardInterrupt, GeneratorExit):
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def _suspect(flying: Mapping[Future[list[Row]], tuple[tuple[Job, ...], int]]) -> bool:
    return any(tries for _, tries in flying.values())


def lost(job: Job, deaths: int) -> Row:
    """The row of a run that has killed so many workers."""
    return {
        "run": job.number,
        "seed": job.seed,
        "point": dict(job.point),
        "error": f"its worker died {deaths} times",
        "seconds": 0.0,
    }


def _end_with_parent() -> None:
    """A worker must not outlive a campaign that was killed: it would wait for work for ever."""

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            _exit(1)

    Thread(target=watch, daemon=True).start()
