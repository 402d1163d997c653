"""`capsule track`: a closed loop in simulation, without a bus."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from controller.choices import CONTROLLERS, leads
from hil.app.console import json_text, output_to_notes, print_json, progress_bar, summary
from hil.app.track_asked import Asked
from hil.app.track_loop import Trace, believed_model, run_loop
from hil.app.track_page import page_html
from hil.app.track_scenario import TrackScenario, load_track_scenario
from hil.app.track_score import document, score
from hil.app.write import check_folder, write_files


def track(path: Path, asked: Asked, compare: bool = False) -> None:
    """Run the scenario file `path` in closed loop and say how well it was tracked; with `compare` under every controller.

    Raises ValueError, one sentence, for anything that cannot be used.
    """
    scenario = load_track_scenario(path)
    values, used = asked.values(scenario.kind)
    name, number = asked.of(scenario)
    names = [one for one in CONTROLLERS if scenario.kind in leads(one)] if compare else [name]
    if compare and asked.controller is not None:
        raise ValueError(f"--compare must stand without --controller, as it runs them all; got --controller {asked.controller}")
    out = asked.out
    if out is not None:
        check_folder(out, "--out")
    runs: list[tuple[dict[str, Any], Trace]] = []
    with output_to_notes():
        believed = believed_model(scenario, values)
        with progress_bar(scenario.name) as report:
            for name in names:
                trace = run_loop(scenario, believed, name, number, report)
                log = None if out is None else str(out / "track.json")
                runs.append((document(scenario, scenario.name, name, number, used, score(scenario, trace), log), trace))
        documents: Any = [found for found, _ in runs] if compare else runs[0][0]
        if out is not None:
            write_files({out / "track.html": page_html(scenario, runs), out / "track.json": json_text(documents)})
    if asked.json_output:
        print_json({"runs": documents} if compare else documents)
    else:
        _say(scenario, [found for found, _ in runs], out)


def _say(scenario: TrackScenario, found: Sequence[dict[str, Any]], out: Path | None) -> None:
    console = summary()
    seconds = f"{scenario.duration_s:g} s, seed {found[0]['seed']}"
    console.print(f"{scenario.name}: {scenario.kind} rig, {seconds}, {found[0]['model']} model", markup=False)
    table = Table(box=None, pad_edge=False)
    for title in (
        "controller",
        "rmse mm",
        "max mm",
        "final mm",
        "mean mm/s",
        "wall mN",
        "effort mN",
        "violations",
        "solve ms",
        "p99",
    ):
        table.add_column(title, justify="left" if title == "controller" else "right")
    for one in found:
        lengths = (f"{1e3 * one[key]:.3f}" for key in ("tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s"))
        forces = (f"{1e3 * one[key]:.1f}" for key in ("wall_force_max_N", "effort"))
        times = (f"{one['solve_ms'][key]:.3f}" for key in ("median", "p99"))
        table.add_row(one["controller"], *lengths, *forces, str(one["hard_violations"]), *times)
    console.print(table)
    if out is not None:
        console.print(f"report: {out / 'track.html'}", markup=False, soft_wrap=True)
