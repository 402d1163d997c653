"""Every kind of page: what makes it."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from controller.supervision.acceptance import Acceptance
from hil.app.campaign.page import Runs
from hil.app.campaign.page import page_html as campaign_html
from hil.app.campaign.series_answers import answer_of
from hil.app.campaign.series_page import page_html as folders_html
from hil.app.demo.example import ExampleResult, Mission
from hil.app.demo.loop import LOOPS
from hil.app.demo.page import demo_html
from hil.app.papers.seeds import write_page
from hil.app.sil.learning_page import PAGE
from hil.report.closed_loop import report_html
from tests.bench.vibro_sweep import vibro_sweep
from tests.conftest import RIG
from tests.hil.app.campaign.test_campaign_folders import answer
from tests.hil.app.design.test_design import VIBRO
from tests.hil.app.sil.test_learning_page import learned_pages
from tests.hil.app.sil.test_sil import SHORT
from tests.hil.findings import left_finding, pull_finding, spectrum_finding, table_finding
from tests.places import ROOT, SCENARIOS

CAPSULE = [sys.executable, "-m", "hil.app.start"]
OWN = ROOT / "examples" / "own_record"
HIDDEN = ("folds and stenosis", "none")


def campaign_page() -> str:
    point = {"scenario.duration_s": 2.0, "tissue.friction_coefficient": 0.06, "case": 0}
    cases = [(k, name, hidden) for k in range(40) for name in ("pid_friction_estimated", "mpc") for hidden in HIDDEN]
    rows: list[dict[str, Any]] = [
        {
            "run": run,
            "point": {
                **point,
                "case": k,
                "tissue.friction_coefficient": 0.06 + 0.001 * k,
                "control.controller": name,
                "hidden": hidden,
            },
            "result": {"tracking_rmse_m": 1e-4 * (1 + k % 7), "hard_violations": 0, "faults": []},
        }
        for run, (k, name, hidden) in enumerate(cases)
    ]
    runs = Runs(rows, "tracking_rmse_m", ["tissue.friction_coefficient"])
    return campaign_html("friction", runs, "capsule campaign c.toml")


def text(make: Callable[[], str]) -> Callable[[Path], Path]:
    """A maker of a page from one of its text."""

    def written(folder: Path) -> Path:
        path = folder / "page.html"
        path.write_text(make(), encoding="utf-8")
        return path

    return written


def command(name: str, *words: str) -> Callable[[Path], Path]:
    """A maker of a page as the command line makes it; OUT stands for where it goes."""

    def ran(folder: Path) -> Path:
        out = folder / "page.html" if name == "plot" else folder
        run = [*CAPSULE, *(word.replace("OUT", str(out)) for word in words)]
        assert subprocess.run(run, check=False, capture_output=True, timeout=300).returncode in (0, 1)
        return next(path for path in (folder / "page.html", folder / f"{name}.html") if path.exists())

    return ran


def rig(text: str, *words: str) -> Callable[[Path], Path]:
    """A maker of the design page of a rig file."""

    def ran(folder: Path) -> Path:
        (folder / "rig.toml").write_text(text, encoding="utf-8")
        return command("design", "design", str(folder / "rig.toml"), "--out", "OUT", *words)(folder)

    return ran


def demo_page() -> str:
    finding = pull_finding(seconds=10.0)
    numbers = {"tracking_rmse_m": 1e-3, "tracking_max_m": 2e-3, "stopped_because": "", "log": "mission.blf"}
    t = np.linspace(0.0, 20.0, 400)
    missions = {
        stage: Mission(numbers, t, 1e-3 * (t + lag * np.sin(t)), 1e-3 * t)
        for stage, lag in (("nominal", 2.0), ("calibrated", 1.0), ("augmented", 0.1))
    }
    truth = {"fold_periodic": {"depth": 0.3, "period_m": 4e-3}}
    gate = {stage: Acceptance() for stage in ("calibrated", "augmented")}
    driven = ExampleResult(finding, gate, missions, truth=truth)
    return demo_html([(LOOPS[0], driven), (LOOPS[0], ExampleResult(finding))], 200.0)


def compared(folder: Path) -> Path:
    """The page of two controllers on the bus, one fault included."""
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    words = ("sil", str(folder / "short.toml"), "--compare", "pid,feedforward", "--out", "OUT")
    return command("sil", *words)(folder)


def sweep_page(folder: Path) -> Path:
    vibro_sweep(folder)
    return folder / "vibro_sweep.html"


def learning_page(folder: Path) -> Path:
    path = folder / PAGE
    path.write_text(learned_pages(folder)[1][PAGE], encoding="utf-8")
    return path


TRACK = str(SCENARIOS / "track_magnetic_ramp_2.toml")
MAKERS: dict[str, Callable[[Path], Path]] = {
    "report": text(lambda: report_html(pull_finding(seconds=10.0))),
    "unknown": text(lambda: report_html(pull_finding("unknown", 10.0))),
    "left": text(lambda: report_html(left_finding())),
    "table": text(lambda: report_html(table_finding())),
    "spectrum": text(lambda: report_html(spectrum_finding())),
    "campaign": text(campaign_page),
    "learning": learning_page,
    "folders": text(
        lambda: folders_html(
            [answer(f"rig_{k:02}", {"viscous_drag": 0.02} if k % 3 else {}, friction=1 + k / 50) for k in range(12)]
            + [answer_of("broken", {"error": "ValueError: t_s must increase"}, "")]
        )
    ),
    "seeds": lambda folder: write_page(folder),
    "demo": text(demo_page),
    "track": command("track", "track", TRACK, "--controller", "mpc", "--out", "OUT"),
    "compare": command("track", "track", TRACK, "--compare", "--out", "OUT"),
    "sil": compared,
    "check": command("check", "check", str(OWN / "pull_1.csv"), "--rig", str(OWN / "rig.toml"), "--out", "OUT"),
    "plot": command("plot", "plot", str(OWN / "pull_1.csv"), "--rig", str(OWN / "rig.toml"), "--out", "OUT"),
    "design": rig(RIG),
    "design_vibro": rig(VIBRO),
    "sweep": sweep_page,
}
