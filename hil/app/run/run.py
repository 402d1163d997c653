"""`capsule run`: the controller alone, on a real actuator bus."""

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from controller.choice.trial import Mission
from controller.choice.world import Localisation
from controller.supervision.fallback import shares
from hil.app import shared_options as options
from hil.app.console import answer, note, output_to_notes, progress_bar
from hil.app.learn.background import Background
from hil.app.learn.compared import Led
from hil.app.learn.learner import Learner, Lesson, check_learnt
from hil.app.run.check import OtherControllerError, Point, check, drives_bus, limits_point, overruns, rehearse
from hil.app.run.clock import Clock, ClockedBus
from hil.app.run.loop import TEXT, Outcome, StopSignals, lead, reset
from hil.app.run.machine import prepare_process
from hil.app.scenario.chosen import Believed, Leading, chosen_of, names_of, spelled, switched
from hil.app.scenario.deployment import Deployment, load_deployment
from hil.app.scenario.model_use import chosen_words, health_of, health_words, motion_beyond, offer_document, offer_words
from hil.app.shared_options import argument, option
from hil.app.write import check_file, check_mcap, check_targets
from hil.bus.authenticated import AuthenticatedBus
from hil.bus.catalogue import load_catalogue
from hil.drives.carriage_bus import CarriageBus
from hil.log.log import FrameLog
from hil.log.place import record_path
from hil.log.recorder import Recorder, log_record
from hil.nodes.node import ControllerNode
from hil.nodes.receive import remedy
from hil.nodes.task import Task
from models.effects import Catalogue
from models.files.toml import check_word, in_file
from models.identification.model import Model

ACTIONS = ("lead", "check", "reset")
GOOD: Final = ("done", "operator", "reset")
"""Values of `end` after which the exit status is 0; all ends stand in the table of docs/bus.md."""
PROBED_S: Final = 0.05  # How long a check leads after its probe, at rest
_TURN_S: Final = 1e-4  # of Python's switch interval


def run(
    path: Annotated[Path, argument("RIG.toml", reads="rig file")],
    *,
    action: Annotated[str, argument("check|reset")] = "lead",
    dry_run: Annotated[bool, typer.Option("--dry-run")] = False,
    log: Annotated[Path | None, option("--log", "LOG.blf")] = None,
    mcap: options.McapFile = None,
    reference: options.ReferenceFile = None,
    json_output: options.Json = False,
    effects: options.OwnEffects,
    controllers: options.OwnControllers,
    learn: options.Learn = False,
    move: Annotated[bool, typer.Option("--move")] = False,
) -> int:
    """Lead, check or reset the drive: 0 where it ended as asked (`GOOD`), else 1. Raises ValueError."""
    check_word(action, "action", ACTIONS)
    deployment = load_deployment(path, reference, Catalogue.read(effects))
    log = log or Path(f"{deployment.name}.blf")
    if move and (action != "check" or dry_run):
        raise ValueError("--move must go with check; got it with leading, reset or --dry-run")
    if action != "check" or move:
        check_targets([check_file(log, "--log", (".blf",)), record_path(log)], "--log", [path])
    if learn:
        check_learnt(deployment.rig)
        if action != "lead" or dry_run:
            raise ValueError("--learn must go with leading; got it with check, reset or --dry-run")
    if mcap is not None:
        check_mcap(mcap, [path, log])
    verdict = deployment.verdict
    if action == "reset" and dry_run:
        raise ValueError("--dry-run must go with leading; got 'reset', which only sends")
    if action == "lead" and verdict is not None and not verdict.passed and not dry_run:
        raise ValueError(f"{path}: model must pass the acceptance test before it leads; got: {verdict.sentence}")
    limits = limits_point(deployment.limits, deployment.rig.kind)
    if action != "check" and not limits.good:
        raise ValueError(f"{path}: {limits.words}")
    chosen = None
    if deployment.learned is not None and action != "reset":
        deployment, chosen = chosen_for(deployment, deployment.learned)
    reached = (
        {}
        if action == "reset"
        else motion_beyond(deployment.covered, deployment.reference, deployment.control.duration_s)
    )
    asked = _Asked(path, deployment, action, dry_run, log, mcap, learn, chosen, reached)
    try:
        if action == "check":
            return _checked(asked, move, json_output)
        return _led(asked, json_output)
    except OtherControllerError as error:
        ended = TEXT("end.no_lead", why=error)
        found = {"rig": str(path), "end": "other_controller", "ended": ended, "remedy": remedy(ended), "led": False}
        answer(json_output, found | {"ticks": 0, "log": None}, f"ended: {ended}", TEXT("run.remedy", **found))
        return 1


@dataclass(frozen=True)
class _Asked:
    path: Path
    deployment: Deployment
    action: str
    dry_run: bool
    log: Path
    mcap: Path | None = None
    learn: bool = False
    leading: Leading | None = None
    beyond: Mapping[str, Any] = field(default_factory=dict)

    @contextmanager
    def begun(self) -> Iterator[tuple[Task, ClockedBus]]:
        """The task and its bus, with prints on standard error. Raises ValueError, OtherControllerError."""
        listens, resets = self.dry_run or self.action == "check", self.action == "reset"
        with output_to_notes():
            task = self.deployment.task()
            with in_file(self.path):
                bus = ClockedBus(drives_bus(self.deployment, self.path.parent, listens, resets), Clock())
            with bus:
                yield task, bus


def chosen_for(deployment: Deployment, model: Model) -> tuple[Deployment, Leading]:
    """The deployment with what leads, chosen before its drive is enabled; a controller that its file states stands."""
    control = deployment.control
    stated = "controller" in control.model_fields_set
    names = [control.controller] if stated else names_of(control.controller, deployment.rig.kind, model)
    with output_to_notes(), progress_bar(TEXT("run.choosing")) as report:
        believed = Believed(lambda values, _: deployment.believed(values))
        found = chosen_of(model, believed, _mission_of(deployment), names, report)
    note(chosen_words(found.document()))
    control = control.but(controller=found.controller)
    return replace(deployment, values=found.values, control=control, others=found.others), found


def _mission_of(deployment: Deployment) -> Mission:
    control = deployment.control
    seen = Localisation(std_m=control.seen_noise_m, quantum_m=control.resolution_m)
    return Mission(deployment.reference, control.duration_s, deployment.limits, seen, control.estimator)


def _checked(asked: _Asked, move: bool, json_output: bool) -> int:
    """Look at all points, move the drive where that is asked for, and print what was found."""
    with asked.begun() as (task, bus):
        points = check(asked.deployment, task, bus)
    if move:
        points.append(_moved(asked, all(p.good for p in points)))
    good = all(p.good for p in points)
    found = {"rig": str(asked.path), "good": good, "points": [point.document() for point in points]}
    answer(json_output, found, *(point.line for point in points))
    return 0 if good else 1


def _led(asked: _Asked, json_output: bool) -> int:
    """Lead or reset, and print the outcome. Raises OtherControllerError where nothing was sent."""
    with asked.begun() as (task, bus):
        outcome, node, frames_log, lessons = _lead(asked, task, bus)
        if outcome.end not in GOOD and isinstance(bus.inner, CarriageBus) and bus.inner.trouble:
            outcome.ended += f"; {bus.inner.trouble}"
    found = _document(asked, outcome, node, frames_log) | {"overruns": overruns(bus)}
    found |= (asked.leading.document() if asked.leading else {}) | {"beyond_records": dict(asked.beyond)}
    found |= offer_document(asked.deployment.offered, node.estimator.taken_at) | switched(node.estimator.switched)
    if isinstance(bus.inner, AuthenticatedBus):
        found["unauthenticated"] = dict(bus.inner.refused)
    if asked.learn:
        found["learned"] = [lesson.document() for lesson in lessons]
    if node.operator is not None:
        found["operator"] = node.operator.document()
    found["monitor"] = health_of(node.estimator.health, node.estimator.origin_s)
    with suppress(ValueError, OSError):
        frames_log.add_to_record({name: found[name] for name in ("ended", "remedy")})
    answer(json_output, found, *_lines(found, lessons))
    return int(found["end"] not in GOOD)


def _moved(asked: _Asked, good: bool) -> Point:
    """Whether the capsule follows the drive: the probe alone, led on the bus, where all else is `good`."""
    if not good:
        return Point("answer", False, TEXT("check.unmoved"))
    short = replace(asked.deployment, control=asked.deployment.control.but(duration_s=PROBED_S, probe=True))
    probing = replace(asked, deployment=short, action="lead", mcap=None)
    with probing.begun() as (task, bus):
        outcome = _lead(probing, task, bus)[0]
    done = outcome.end == "done"
    return Point("answer", done, TEXT("check.moved") if done else outcome.ended)


def _lead(asked: _Asked, task: Task, bus: ClockedBus) -> tuple[Outcome, ControllerNode, FrameLog, list[Lesson]]:
    deployment, path, dry_run = asked.deployment, asked.log, asked.dry_run
    catalogue, control = load_catalogue(), deployment.control
    record = log_record(
        {"deployment": deployment.text},
        control.controller,
        deployment.values,
        deployment.limits,
        catalogue,
        dry_run=dry_run,
        bus=vars(deployment.bus),
        offered=deployment.offered and deployment.offered.document(),
        others=spelled(deployment.others),
        clock_origin_ns=bus.clock.origin_ns,
    )
    rehearse(task)
    with (
        FrameLog(path, record, note, asked.mcap) as frames_log,
        StopSignals().caught() as signals,
        ExitStack() as beside,
    ):
        if frames_log.kept is not None:
            note(TEXT("run.kept", log=frames_log.kept))
        if frames_log.path != path:
            note(TEXT("run.log_in_use", path=path, log=frames_log.path))
        recorder = Recorder(frames_log, dry_run)
        node = ControllerNode(task, bus, observer=recorder, dry_run=dry_run)
        learner = beside.enter_context(_learning(deployment, node, frames_log)) if asked.learn else None
        refused = prepare_process(control.priority, control.core)
        if control.priority > 0 and not refused:
            frames_log.hasten(1)
        for sentence in refused:
            note(sentence)
        if asked.action == "reset":
            outcome = reset(node, bus.clock, recorder, signals)
        else:
            note(TEXT("run.leading", name=deployment.name, seconds=control.duration_s))
            outcome = lead(node, bus.clock, control.duration_s, recorder, signals, control.give_up_s, learner)
    return outcome, node, frames_log, [] if learner is None else learner.lessons


@contextmanager
def _learning(deployment: Deployment, node: ControllerNode, frames_log: FrameLog) -> Iterator[Learner]:
    """The learner of a run: a process identifies, a thread builds and writes; both start before the first tick."""
    maker, turn_s = ThreadPoolExecutor(1), sys.getswitchinterval()

    def keep(record: Mapping[str, Any]) -> None:
        maker.submit(frames_log.add_to_record, record)

    with maker, Background() as background:
        background.begin()
        maker.submit(int).result()
        sys.setswitchinterval(_TURN_S)
        try:
            yield Learner(
                node.estimator,
                deployment.rig,
                deployment.values,
                deployment.believed,
                background,
                deployment.learning.model_copy(update={"answer_s": math.inf}),
                maker.submit,
                keep,
                node.drive,
                Led(_mission_of(deployment), node.wanted, node.tick_s),
            )
        finally:
            sys.setswitchinterval(turn_s)


def _document(asked: _Asked, outcome: Outcome, node: ControllerNode, frames_log: FrameLog) -> dict[str, Any]:
    grid, missing = outcome.grid, frames_log.dropped + frames_log.lost
    whole = not missing and not frames_log.troubles
    good = outcome.end in GOOD
    return {
        "rig": str(asked.path),
        "controller": node.task.controller,
        "dry_run": asked.dry_run,
        "end": outcome.end if whole or not good else "log",
        "ended": "; ".join([outcome.ended, *(frames_log.troubles[-1:] if good and not whole else [])]),
        "remedy": "" if good else remedy(outcome.ended),
        "led": outcome.led,
        "led_share": shares(node.answer.led),
        "jumps": {"count": node.answer.jumps, "last_m": node.answer.jump_m},
        "ticks": grid.ticks,
        "missed_ticks": grid.missed,
        "cut_ticks": outcome.cut,
        "late_ms": grid.late.document(),
        "tick_ms": outcome.busy.document(),
        "rejected": node.receiver.rejected,
        "refused_frames": node.receiver.refused,
        "other_types": dict(node.receiver.strange),
        "other_controller": dict(node.receiver.foreign),
        "deaf_ticks": node.receiver.deaf,
        "full_ticks": node.receiver.full,
        "refused": sum(node.guard.refused.values()),
        "unsent": node.guard.unsent,
        "log": str(frames_log.path),
        "log_dropped": missing,
        "log_troubles": frames_log.troubles,
    }


def _lines(found: dict[str, Any], lessons: Sequence[Lesson]) -> Iterator[str]:
    yield TEXT("run.ended", **found)
    if found["remedy"]:
        yield TEXT("run.remedy", **found)
    yield from found["log_troubles"]
    yield TEXT("run.late", **found["late_ms"])
    yield TEXT("run.took", **found["tick_ms"])
    if found["cut_ticks"]:
        yield TEXT("run.cut", plans=found["cut_ticks"])
    words = (chosen_words(found), health_words(found), offer_words(found), *(lesson.words for lesson in lessons))
    yield from filter(None, words)
    yield f"log: {found['log']}"
