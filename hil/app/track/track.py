"""`capsule track`: a closed loop in simulation, without a bus."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from controller.registry import CONTROLLERS, leads
from controller.supervision.fallback import DONE, not_led, shares
from hil.app import shared_options as options
from hil.app.console import answer, json_text, output_to_notes, part_of, progress_bar
from hil.app.scenario.chosen import Believed, leading_of, mission_of, switched
from hil.app.scenario.model_use import offer_document, offer_of, read_offer
from hil.app.scenario.scenario import load_track_scenario
from hil.app.shared_options import argument, option
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import document, score, verdicts
from hil.app.track.summary import TEXT, LoopRun, lines_of, lines_of_runs, page_html
from hil.app.write import own_folder, write_files
from models.effects import Catalogue


def track(
    path: Annotated[Path, argument("SCENARIO.toml", reads="scenario")],
    *,
    controller: options.ControllerName = None,
    model: options.LearnedModel = None,
    stage: options.StageOrScenario = None,
    seed: options.RunSeed = None,
    reference: options.ReferenceFile = None,
    compare: Annotated[bool, typer.Option("--compare")] = False,
    out: Annotated[Path | None, option("--out", "DIR")] = None,
    json_output: options.Json = False,
    effects: options.OwnEffects,
    controllers: options.OwnControllers,
) -> int:
    """Run a scenario in closed loop: 1 where a run fails a check or did not go as asked. Raises ValueError."""
    with own_folder(out, "--out"):
        known = Catalogue.read(effects)
        scenario = load_track_scenario(path, reference).knowing(known)
        if compare and controller is not None:
            raise ValueError(f"--compare runs all controllers, so it must stand without --controller; got {controller}")
        number, log = scenario.seed if seed is None else seed, None if out is None else str(out / "track.json")
        with output_to_notes():
            believed, runs = Believed(partial(believed_model, scenario)), list[LoopRun]()
            leading = leading_of(model, stage, controller, scenario, known, believed)
            leads_on, others = believed(leading.values), leading.beside(believed)
            offered = read_offer(scenario.offer, path.parent, scenario.belief, leading.values)
            offer = offer_of(offered, lambda new: believed(new, leads_on))
            able = [name for name in CONTROLLERS if scenario.kind in leads(name)]
            names = leading.seeing(mission_of(scenario), believed, able if compare else [leading.controller])
            with progress_bar(scenario.name, even=True) as report:
                for k, name in enumerate(names):
                    part = part_of(report, k / len(names), (k + 1) / len(names))
                    trace = run_loop(scenario, leads_on, name, number, part, offer=offer, others=others)
                    worth = score(scenario, trace)
                    found = document(scenario, name, number, leading.stage, worth, log)
                    found |= leading.document() | offer_document(offered, trace.taken_at) | switched(trace.switched)
                    found["ended"] = trace.halted or not_led(trace.led, trace.first) or DONE
                    found["led_share"] = shares(trace.led)
                    if leads_on.rig.magnets is not None:
                        found["height_m"] = leads_on.rig.magnets.height_m
                    found["checks"] = verdicts(scenario, name, trace, worth)
                    runs.append(LoopRun(scenario, found, trace, lines_of(found)))
        documents: Any = {"runs": [run.found for run in runs]} if compare else runs[0].found
        head = TEXT("run", kind=scenario.kind, seconds=scenario.duration_s, seed=number)
        if out is not None:
            write_files({out / "track.html": page_html(head, runs), out / "track.json": json_text(documents)})
    answer(json_output, documents, *lines_of_runs(head, runs, out and out / "track.html"))
    failed = any(not check["passed"] for run in runs for check in run.found["checks"])
    return int(failed or any(run.found["ended"] != DONE for run in runs))
