"""The demo: loops that are driven, logged, judged by the gate and driven again; a page and numbers; complete or not at
all.
"""

import html
import json
import time
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hil.app.demo.demo as demo_module
import hil.app.demo.example as example_module
from controller.supervision.acceptance import Acceptance
from hil.app.demo.demo import demo, results_of
from hil.app.demo.example import NEXT_RECORD, PRINTED, SCENARIOS, ExampleResult, Mission, Progress
from hil.app.demo.loop import LEARNING, LOOPS, LearningExample, LoopExample, admitted
from hil.app.demo.page import demo_html
from hil.app.learn import identify
from hil.app.learn.identify import LearningAnswer
from hil.app.main import run
from hil.app.scenario.bus_scenario import load_sil_scenario, parse_sil_scenario
from models.effects import effect_words
from models.files.toml import read_toml, toml_text
from models.identification import Model
from models.identification.finding import STAGES, Finding
from models.records.record import read_record
from models.rigs.reader import parse_rig, read_rig
from models.theta import Theta
from tests.hil.findings import pull_finding

FOLDS = Theta(
    effects={
        "fold_periodic": {"depth": 0.29, "wavelength_m": 0.0073, "phase_rad": 0.4, "second_sin": 0.2, "second_cos": 0.2}
    }
)
TRUTH = Theta({"friction_coefficient": 0.088, "hoop_stress_factor": 1.09, "magnet_stiffness_N_per_m": 24.2})
VALUES = st.one_of(
    st.integers(-(10**6), 10**6), st.booleans(), st.text(max_size=8), st.floats(allow_nan=False, allow_infinity=False)
)
KEYS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)


def short_example(folder: Path) -> LoopExample:
    """The magnetic loop in a few seconds of simulated time."""
    raw = tomllib.loads((SCENARIOS / "demo_magnetic.toml").read_text(encoding="utf-8"))
    raw["scenario"]["duration_s"] = 2.0
    raw["reference"]["speed_mm_s"] = 4.0
    (folder / "scenario.toml").write_text(toml_text(raw))
    ramp = {"duration_s": 1.2, "reference": {"kind": "ramp", "speed_mm_s": 3.0}}
    return LoopExample("magnetic", folder / "scenario.toml", (ramp,), ramp)


def learned(holdout: Mapping[str, float]) -> tuple[Finding, Model]:
    """A finding with these held-out errors and a model whose stages are nominal, true but for the effect, and true."""
    finding = replace(
        pull_finding(), kind="magnetic", quantity="position_m", columns=("position_m",), unit="m", error_unit="m"
    )
    finding = replace(finding, error={"train": dict(holdout), "holdout": dict(holdout)})
    nominal = Theta({"friction_coefficient": 0.082, "hoop_stress_factor": 1.0, "magnet_stiffness_N_per_m": 25.0})
    return finding, Model("magnetic", {"nominal": nominal, "calibrated": TRUTH, "augmented": TRUTH | FOLDS}, "named")


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ExampleResult, list[tuple[str, float]], list[Any]]:
    """A loop whose search is answered beforehand: its folder, what came of it, what it said, and what the search was
    given.
    """
    folder, seen, said = tmp_path_factory.mktemp("driven"), list[Any](), list[tuple[str, float]]()

    def close(*given: Any, seed: int) -> Any:
        seen.extend([*given[:3], seed])
        given[3]("calibrating", 0.5)
        return learned({"nominal": 1.1e-3, "calibrated": 0.7e-3, "augmented": 5e-5})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(example_module, "close", close)
        one = short_example(folder).run(folder, 3, lambda stage, share: said.append((stage, share)))
    return folder, one, said, seen


Driven = tuple[Path, ExampleResult, list[tuple[str, float]], list[Any]]


def test_a_loop_is_driven_logged_judged_and_driven_again(driven: Driven) -> None:
    _, one, said, (rig, train, held, seed) = driven
    assert [record.name for record in train] == ["train_1"]
    assert [record.name for record in held] == ["holdout"]
    assert (rig.kind, seed) == ("magnetic", 3)
    assert all(len(record) >= 100 for record in (*train, *held))
    assert list(one.missions) == list(STAGES)
    assert all(one.gate[stage].passed for stage in STAGES[1:])
    errors = {stage: mission.numbers["tracking_rmse_m"] for stage, mission in one.missions.items()}
    assert errors["augmented"] < 0.5 * errors["calibrated"]
    assert {mission.numbers["seed"] for mission in one.missions.values()} == {3001}
    assert tuple(one.truth) == ("fold_periodic",)
    assert one.caution == ""
    assert one.truth["fold_periodic"]["wavelength_m"] > 0
    shares = [share for _, share in said]
    assert shares == sorted(shares)
    assert said[-1] == ("done", 1.0)


def test_what_a_loop_leaves_can_be_run_again(driven: Driven, capsys: pytest.CaptureFixture[str]) -> None:
    folder, one, *_ = driven
    assert run(["replay", str(folder / "mission_augmented.blf"), "--json"]) == 0
    capsys.readouterr()
    words = ["--model", str(folder / "model.toml"), "--stage", "augmented", "--json"]
    assert run(["sil", str(folder / "mission.toml"), *words]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["tracking_rmse_m"] == one.missions["augmented"].numbers["tracking_rmse_m"]


@pytest.mark.parametrize(
    ("held_out", "let_in", "said"),
    [
        ((1.1e-3, 0.7e-3, 0.7e-3), ["calibrated"], "at most 0.99 of the current model's 0.0007"),
        ((1.0e-3, 1.2e-3, 1.1e-3), [], "at most 0.99 of the current model's 0.001"),
        ((1.0e-3, 1.2e-3, 0.5e-3), ["augmented"], "passed"),
    ],
)
def test_the_gate_holds_each_model_against_the_last_that_it_let_in(
    held_out: tuple[float, float, float], let_in: list[str], said: str
) -> None:
    finding, model = learned(dict(zip(STAGES, held_out, strict=True)))
    gate = dict(admitted(finding, model, parse_sil_scenario(LOOPS[0].runs(0)["mission"]).loop.belief))
    assert [stage for stage, verdict in gate.items() if verdict.passed] == let_in
    assert said in gate["augmented"].sentence


def test_a_model_that_was_refused_is_said_to_be(driven: Driven) -> None:
    one = driven[1]
    missions = {stage: one.missions[stage] for stage in STAGES[:2]}
    gate = {**one.gate, "augmented": Acceptance(("held-out error must be lower",))}
    page = demo_html([(LOOPS[0], replace(one, missions=missions, gate=gate))], 1.0)
    assert "with the calibrated model" in page
    assert "held-out error must be lower" in page


@pytest.mark.parametrize("example", LOOPS, ids=[example.name for example in LOOPS])
def test_a_loop_hides_its_effect_and_states_all_that_is_believed(example: LoopExample) -> None:
    runs = example.runs(0)
    scenarios = {name: parse_sil_scenario(tables) for name, tables in runs.items()}
    assert load_sil_scenario(example.scenario)[0].loop.belief == scenarios["mission"].loop.belief
    assert len({scenario.loop.seed for scenario in scenarios.values()}) == len(runs)
    assert not {s.loop.seed for s in scenarios.values()} & {
        parse_sil_scenario(t).loop.seed for t in example.runs(1).values()
    }
    references = [json.dumps(tables["reference"], sort_keys=True) for tables in runs.values()]
    assert len(set(references)) == len(references)
    for scenario in scenarios.values():
        assert list(scenario.loop.truth.hidden) == list(runs["mission"]["effects"])
        assert scenario.loop.belief == parse_rig(runs["mission"]["belief"], "belief")


@given(
    st.recursive(
        st.dictionaries(KEYS, st.one_of(VALUES, st.lists(VALUES, max_size=3)), max_size=4),
        lambda inner: st.dictionaries(KEYS, st.one_of(VALUES, inner), max_size=4),
        max_leaves=8,
    )
)
def test_tables_read_back_as_they_were(tables: dict[str, Any]) -> None:
    assert tomllib.loads(toml_text(tables)) == tables


@dataclass(frozen=True)
class Quick:
    """An example that ends at once, fails, or never ends."""

    name: str
    fault: str = ""

    def run(self, folder: Path, seed: int, report: Progress) -> ExampleResult:
        report("begun", 0.1)
        (folder / "report.html").write_text("a quick example")
        if self.fault == "refused":
            raise ValueError("records must be there; got none")
        if self.fault == "died":
            raise SystemExit(3)
        if self.fault == "endless":
            time.sleep(600)
        finding, _ = learned({"nominal": 2e-3, "calibrated": 1e-3, "augmented": 1e-4})
        numbers = {"tracking_rmse_m": 1e-3, "tracking_max_m": 2e-3, "stopped_because": "", "log": "mission.blf"}
        time_s, at_m, to_m = (finding.traces[0].signals[name][:50] for name in ("t_s", "x_m", "x_m"))
        missions = {stage: Mission(numbers, time_s, at_m, to_m) for stage in STAGES}
        gate = {stage: Acceptance() for stage in STAGES[1:]}
        return ExampleResult(finding, gate, missions, truth={"fold_periodic": {"excess": 0.3}})


@pytest.mark.slow
def test_records_that_cannot_tell_lead_to_the_one_that_tells(tmp_path: Path) -> None:
    said: list[tuple[str, float]] = []
    one = NEXT_RECORD.run(tmp_path, 4, lambda stage, share: said.append((stage, share)))
    (poor,) = one.before.effects if one.before else ()
    (rich,) = one.finding.effects
    assert {poor.id, *poor.equivalent} == {"tissue_drying", "lumen_taper", "preconditioning", "fluid_plug"}
    assert (rich.id, rich.equivalent) == ("tissue_drying", ())
    assert tuple(one.truth) == ("tissue_drying",)
    assert one.before
    assert one.before.proposal
    run, proposed = read_toml(tmp_path / "next.toml", "scenario")[0], one.before.proposal
    assert run["scenario"]["duration_s"] == pytest.approx(proposed.times_s[-1], abs=1e-3)
    driven = read_record(tmp_path / "next.csv", read_rig(tmp_path / "rig.toml"))
    at = np.interp(driven["t_s"], proposed.motion["t_s"], proposed.motion["position_m"])
    assert driven["position_m"] == pytest.approx(at, abs=1e-6)
    assert [trace.role for trace in one.finding.traces].count("holdout") == 1
    shares = [share for _, share in said]
    assert shares == sorted(shares)
    page = html.unescape(demo_html([(NEXT_RECORD, one)], 1.0))
    assert f"with the proposed record: named: {effect_words('tissue_drying')}" in page
    assert "next_record/before/report.html" in page
    nothing = replace(one, before=replace(one.before, proposal=None, verdict="unknown", effects=()))
    assert "Verdict before: unknown;" in demo_html([(NEXT_RECORD, nothing)], 1.0)


def test_a_run_learns_and_its_example_stands_in_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    raw = tomllib.loads(LEARNING.scenario.read_text(encoding="utf-8"))
    raw["scenario"]["duration_s"] = 32.0
    raw["effects"]["fold_periodic"] |= {"excess": 0.4, "onset_s": 6.0}
    raw["reference"]["positions_mm"] = raw["reference"]["positions_mm"][:5]
    raw["learning"] = {"gathered_s": 10.0, "answer_s": 1.0, "trial_s": 5.0}
    (tmp_path / "scenario.toml").write_text(toml_text(raw))
    found = LearningAnswer(Theta.of(TRUTH | FOLDS), ("fold_periodic",), "named", "lower held-out error", seconds=1.0)
    monkeypatch.setattr(identify, "answer", lambda question: found)
    (tmp_path / "out").mkdir()
    one = LearningExample("learning", tmp_path / "scenario.toml").run(tmp_path / "out", 2, lambda stage, share: None)
    assert one.found["seed"] == 2001
    assert tuple(one.truth) == ("fold_periodic",)
    assert "folds of the gut learned and taken at" in one.sentence
    lesson, *_ = one.numbers["learned"]
    assert 6.0 <= lesson["broken_at_s"] < 12.0
    assert lesson["taken_at_s"] > lesson["asked_at_s"] + 1.0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "learning.html", "learning.json", "scenario.toml", "sil.json",
    ]  # fmt: skip
    page = demo_html([(Quick("learning"), one)], 1.0)
    assert one.sentence in page
    assert "learning/learning.html" in page


@pytest.mark.usefixtures("loaded_once")
def test_the_demo_leaves_page_numbers_and_reports(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    monkeypatch.setattr(demo_module, "EXAMPLES", [Quick("first"), Quick("second")])
    demo(out, json_output=True)
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert document == json.loads((out / "demo.json").read_text())
    assert sorted(path.name for path in out.iterdir()) == ["demo.html", "demo.json", "first", "second"]
    first = document["stories"][0]
    assert (first["story"], first["hidden"], first["verdict"]) == ("first", "fold_periodic", "named")
    assert first["error"]["holdout"]["augmented"] == 1e-4
    assert first["gate"]["augmented"] == {"passed": True, "reasons": []}
    assert first["tracking"]["augmented"]["tracking_rmse_m"] == 1e-3
    assert Path(first["report"]).read_text() == "a quick example"
    page = (out / "demo.html").read_text()
    assert all(words in page for words in ("Residual", "Effect", "Prediction", "Acceptance test", "The same run again"))
    assert "first:  10 %  begun" in said.err


@pytest.mark.usefixtures("loaded_once")
@pytest.mark.parametrize(
    ("fault", "raised", "said"), [("refused", ValueError, "got none"), ("died", RuntimeError, "status 3")]
)
def test_a_example_that_fails_leaves_nothing(
    tmp_path: Path, fault: str, raised: type[Exception], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo_module, "EXAMPLES", [Quick("bad", fault=fault)])
    with pytest.raises(raised, match=said):
        demo(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_interruption_ends_every_process_at_once(tmp_path: Path) -> None:
    began = []

    def report(name: str, stage: str, share: float) -> None:
        began.append(time.monotonic())
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        results_of([Quick("endless", fault="endless")], tmp_path, 0, report)
    assert time.monotonic() - began[0] < 20


def test_an_interruption_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo_module, "results_of", interrupted)
    assert run(["demo", "--out", str(tmp_path / "o")]) == 130
    assert not (tmp_path / "o").exists()
    assert "interrupted" in capsys.readouterr().err


def test_printed_measurements_need_no_drive(tmp_path: Path) -> None:
    one = PRINTED[0].run(tmp_path, 0, lambda stage, share: None)
    assert "this is an interpolation" in one.caution
    assert "period −0.6 %, valley +7.7 % and peak −7.4 %" in one.caution
    assert one.caution in html.unescape(demo_html([(PRINTED[0], one)], 1.0))
    assert one.finding.kind == "periods" == read_rig(tmp_path / "rig.toml").kind
    assert (one.gate, one.missions, one.truth) == ({}, {}, {})
    assert (tmp_path / "report.html").exists()
