"""`capsule track`: a closed loop in simulation, without a bus."""

from functools import partial
from pathlib import Path
from typing import Any

from controller.registry import CONTROLLERS, leads
from controller.supervision.fallback import DONE, not_led, shares
from hil.app.console import json_text, note, output_to_notes, print_json, progress_bar
from hil.app.scenario.model_offer import offer_of, read_offer, told
from hil.app.scenario.options import Options
from hil.app.scenario.scenario import load_track_scenario
from hil.app.track.loop import Progress, Trace, believed_model, run_loop
from hil.app.track.page import page_html
from hil.app.track.score import document, score
from hil.app.track.summary import say
from hil.app.track.verdicts import verdicts
from hil.app.write import write_files


def _part(report: Progress, number: int, count: int, stage: str, share: float) -> None:
    """Progress of run `number` of `count`."""
    report(stage, (number + share) / count)


def track(path: Path, asked: Options, compare: bool = False) -> int:
    """Run the scenario file `path` in closed loop and say how well it was tracked; with `compare` under every
    controller.

    The exit status is 1 where a run fails one of the scenario's checks. Raises ValueError, one sentence, for anything
    that cannot be used.
    """
    scenario = asked.equipped(load_track_scenario(path, asked.reference))
    values, used = asked.values(scenario.kind)
    name, number = asked.of(scenario)
    names = [one for one in CONTROLLERS if scenario.kind in leads(one)] if compare else [name]
    if compare and asked.controller is not None:
        raise ValueError(
            f"--compare must stand without --controller, as it runs them all; got --controller {asked.controller}"
        )
    out = asked.out
    runs: list[tuple[dict[str, Any], Trace]] = []
    with output_to_notes():
        believed = believed_model(scenario, values)
        offered = read_offer(scenario.offer, path.parent, scenario.belief, values)
        offer = offer_of(offered, lambda new: believed_model(scenario, new, believed))
        late, latest = scenario.instruments.localisation.latency_s, scenario.limits.age_s
        if late >= latest:
            note(f"localisation comes {late:g} s late and is not used: limits.age_s is {latest:g} s")
        with progress_bar(scenario.name, even=True) as report:
            for k, name in enumerate(names):
                part = partial(_part, report, k, len(names))
                trace = run_loop(scenario, believed, name, number, part, offer=offer)
                log = None if out is None else str(out / "track.json")
                worth = score(scenario, trace)
                found = document(scenario, scenario.name, name, number, used, worth, log)
                found |= told(offered, trace.taken_at)
                found["ended"] = trace.halted or not_led(trace.led, trace.first) or DONE
                found["led_share"] = shares(trace.led)
                if believed.rig.magnets is not None:
                    found["height_m"] = believed.rig.magnets.height_m
                found["checks"] = [one.document() for one in verdicts(scenario, name, trace, worth)]
                runs.append((found, trace))
        documents: Any = [found for found, _ in runs] if compare else runs[0][0]
        if out is not None:
            write_files({out / "track.html": page_html(scenario, runs), out / "track.json": json_text(documents)})
    if asked.json_output:
        print_json({"runs": documents} if compare else documents)
    else:
        say(scenario, [found for found, _ in runs], out)
    return int(any(not check["passed"] for found, _ in runs for check in found["checks"]))
