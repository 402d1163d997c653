"""`capsule sil`: a closed loop over the simulated CAN bus, with controller and plant as nodes in lockstep."""

import contextlib
import math
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

import can

from controller.choice.choose import Progress
from controller.model.control_model import ControlModel
from controller.registry import CONTROLLERS
from controller.supervision.fallback import DONE
from hil.app import shared_options as options
from hil.app.console import answer, json_text, output_to_notes, part_of, progress_bar
from hil.app.learn.background import Background
from hil.app.learn.learner import check_learnt
from hil.app.scenario.bus_scenario import SilScenario, load_sil_scenario, watched_bus
from hil.app.scenario.chosen import Believed, Leading, leading_of, mission_of, spelled, switched
from hil.app.scenario.model_use import Offered, offer_document, offer_of, read_offer
from hil.app.shared_options import argument, option
from hil.app.sil.fault_outcomes import outcomes
from hil.app.sil.learning_page import learning_files
from hil.app.sil.loop import TEXT, Shown, SilTrace, judged_loop, learning_of, run_sil
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.score import document, score
from hil.app.track.summary import LoopRun, lines_of, lines_of_runs, page_html
from hil.app.write import check_folder, check_mcap, own_folder, write_files
from hil.log.log import LockstepLog
from hil.log.mcap_log import McapLog
from hil.log.recorder import Recorder, log_record
from hil.nodes.frame_map import frames
from hil.nodes.receive import remedy
from models.effects import Catalogue
from models.files.toml import check_word

PAGE: Final = "sil.html"


def sil(
    path: Annotated[Path, argument("SCENARIO.toml", reads="scenario")],
    *,
    controller: options.ControllerName = None,
    model: options.LearnedModel = None,
    stage: options.StageOrScenario = None,
    seed: options.RunSeed = None,
    reference: options.ReferenceFile = None,
    compare: Annotated[str | None, option("--compare", "NAME,NAME")] = None,
    out: Annotated[Path | None, option("--out", "DIR")] = None,
    learn: options.Learn = False,
    mcap: options.McapFile = None,
    watch: Annotated[str | None, option("--watch", "CHANNEL")] = None,
    json_output: options.Json = False,
    effects: options.OwnEffects,
    controllers: options.OwnControllers,
) -> int:
    """Run a scenario over the bus: 1 where it ended early or another controller led. Raises ValueError."""
    alone = {"--controller": controller, "--learn": learn, "--mcap": mcap, "--watch": watch}
    names = [] if compare is None else _compared(compare, alone)
    with own_folder(out, "--out"):
        known = Catalogue.read(effects)
        scenario, text = load_sil_scenario(path, reference)
        scenario = replace(scenario, loop=scenario.loop.knowing(known))
        if learn:
            check_learnt(scenario.loop.belief)
        number = scenario.loop.seed if seed is None else seed
        if mcap is not None:
            if out is None:
                raise ValueError(f"--mcap must go with --out, the folder of the log; got --mcap {mcap} alone")
            check_mcap(mcap, [path])
        with output_to_notes():
            on_bus = partial(believed_on_bus, scenario)
            believed = Believed(lambda values, _: on_bus(values))
            leading = leading_of(model, stage, controller, scenario.loop, known, believed)
            names = leading.seeing(mission_of(scenario.loop), believed, names or [leading.controller])
            offered = read_offer(scenario.loop.offer, path.parent, scenario.loop.belief, leading.values)
            asked = _Asked(scenario, text, number, leading, believed, offered, out, mcap, apart=compare is not None)
            with (
                nullcontext() if watch is None else watched(watch) as shown,
                progress_bar(scenario.loop.name, even=True) as report,
                Background() if learn else nullcontext() as background,
            ):
                parts = [part_of(report, k / len(names), (k + 1) / len(names)) for k in range(len(names))]
                runs = [asked.run(name, part, shown, background) for name, part in zip(names, parts, strict=True)]
            documents: Any = runs[0].found if compare is None else {"runs": [one.found for one in runs]}
            head = TEXT("run", kind=scenario.loop.kind, seconds=scenario.loop.duration_s, seed=number)
            if out is not None:
                write_files({out / PAGE: page_html(head, runs), out / "sil.json": json_text(documents)})
    answer(json_output, documents, *lines_of_runs(head, runs, out and out / PAGE))
    return int(any(one.found["ended"] != DONE for one in runs))


@contextlib.contextmanager
def watched(channel: str) -> Iterator[Shown]:
    """What sends every frame to the local bus `channel` in real time; frames for a full queue are dropped. Raises
    ValueError where the bus cannot be opened.
    """
    zero_s = math.nan

    def show(message: can.Message) -> None:
        nonlocal zero_s
        now = time.monotonic()
        zero_s = now - message.timestamp if math.isnan(zero_s) else zero_s
        time.sleep(max(0.0, zero_s + message.timestamp - now))
        with contextlib.suppress(can.CanError):
            bus.send(message)

    with watched_bus(channel) as bus:
        yield show


@dataclass(frozen=True)
class _Asked:
    """What the runs of a call share; `apart`: each has its log in a folder of its name in `out`."""

    scenario: SilScenario
    text: str
    seed: int
    leading: Leading
    believed: Believed
    offered: Offered | None
    out: Path | None
    mcap: Path | None
    apart: bool

    def run(self, name: str, report: Progress, shown: Shown | None, background: Background | None) -> LoopRun:
        """The run with the controller `name`; with `background` it learns, and writes the page of that."""
        scenario, leading, believed = self.scenario, self.leading, self.believed
        learning = None if background is None else learning_of(scenario, leading.values, background)
        more: dict[str, Any] = {"offer": offer_of(self.offered, believed), "others": leading.beside(believed)}
        with self._log(name) as log:
            more |= {"recorder": None if log is None else Recorder(log), "learning": learning, "shown": shown}
            found, trace = judged(scenario, believed(leading.values), name, self.seed, leading.stage, report, **more)
        found |= leading.document() | offer_document(self.offered, trace.taken_at) | switched(trace.switched)
        if learning is not None:
            found["learned"] = [lesson.document() for lesson in trace.lessons]
        if log is not None:
            found["log"] = str(log.path)
            log.add_to_record(trace.learned)
        if self.out is not None and learning is not None:
            write_files(learning_files(self.out, scenario, found, trace))
        lines = [*lines_of(found), *bus_lines(found), *(lesson.words for lesson in trace.lessons)]
        return LoopRun(judged_loop(scenario, trace), found, trace, lines)

    def _log(self, name: str) -> AbstractContextManager[LockstepLog | None]:
        if self.out is None:
            return nullcontext()
        leading, offered = self.leading, self.offered
        stated = {"seed": self.seed, "offered": offered and offered.document(), "others": spelled(leading.others)}
        limits = self.scenario.loop.limits
        record = log_record({"scenario": self.text}, name, leading.values, limits, frames(), **stated)
        folder = check_folder(self.out / name, "--out") if self.apart else self.out
        return LockstepLog(folder / "frames.blf", record, mcap=None if self.mcap is None else McapLog(self.mcap))


def _compared(names: str, alone: Mapping[str, object]) -> list[str]:
    """The controllers of `--compare`; none of the options `alone` may stand beside it."""
    if beside := [option for option, value in alone.items() if value]:
        raise ValueError(f"--compare must stand without {beside[0]}; got both")
    found = names.split(",")
    for name in found:
        check_word(name, "--compare", list(CONTROLLERS))
    if len(found) != len(set(found)):
        raise ValueError(f"--compare must name different controllers, with commas between them; got {names!r}")
    return found


def judged(
    scenario: SilScenario,
    model: ControlModel,
    controller: str | None,
    seed: int,
    used: str,
    report: Any = None,
    **more: Any,
) -> tuple[dict[str, Any], SilTrace]:
    """One run and its JSON object, scored against the reference in force; `more` goes to `run_sil`."""
    name = controller or scenario.loop.control.controller
    trace = run_sil(scenario, model, name, seed, report, **more)
    loop = judged_loop(scenario, trace)
    found = document(loop, name, seed, used, score(loop, trace))
    found["bus"] = {"frames": trace.frames, "load": trace.load, "rejected": trace.rejected}
    if scenario.bus.key_file:
        found["bus"]["unauthenticated"] = trace.unauthenticated
    if trace.operator is not None:
        found["operator"] = trace.operator
    found["faults"] = [outcome.document() for outcome in outcomes(scenario, trace)]
    found["ended"], found["remedy"], found["led_share"] = trace.ended, remedy(trace.ended), trace.led_share
    return found, trace


def bus_lines(found: Mapping[str, Any]) -> Iterator[str]:
    bus = found["bus"]
    yield TEXT("bus", **bus)
    if kinds := bus.get("unauthenticated"):
        yield TEXT("not_authentic", counts=[f"{count} {kind}" for kind, count in sorted(kinds.items())])
    if operator := found.get("operator"):
        yield TEXT("operator", **operator)
    for fault in found["faults"]:
        outcome = TEXT("ridden" if fault["safe_after_ms"] is None else "safe", **fault)
        outcome += TEXT("distance", **fault) if "distance_mm" in fault else ""
        yield TEXT("fault", outcome=outcome + (TEXT("unsafe") if fault["unsafe"] else ""), **fault)
    if found["remedy"]:
        yield TEXT("remedy", **found)
