"""What leads a run with a model that carries a choice: in the plant it is no worse than nominal model or PID, and
`--stage` and `--controller` given by hand stand.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import hil.app.scenario.chosen
import hil.app.track.loop
from controller.choice.sight import unfit
from controller.choice.trial import Mission
from controller.model.control_model import ControlModel, control_model
from hil.app.main import run
from hil.app.scenario.chosen import Believed, Leading, chosen_of, leading_of, mission_of, names_of, worlds_of
from hil.app.scenario.model_use import values_of
from hil.app.scenario.scenario import TrackScenario, load_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.effects import CATALOGUE
from models.identification import Model
from models.rigs.rig import Rig
from models.theta import Theta
from tests.bench.bench_localisation import seen

WORSE = 1.05
SCENARIO = """
[scenario]
name = "{name}"
duration_s = 5.0
seed = 4
[rig]
kind = "magnetic"
{effects}
[localisation]
std = 0.1e-3
[reference]
kind = "waypoints"
times_s = [0.5, 2.0, 2.5, 3.5, 5.0]
positions_mm = [0.0, 4.0, 4.0, 1.0, 5.0]
"""
LAG = "[effects.actuator_lag]\ntime_s = 0.11"


def scenario_of(folder: Path, effects: str) -> TrackScenario:
    """The scenario with the hidden `effects` of the plant."""
    path = folder / "scenario.toml"
    path.write_text(SCENARIO.format(name="chosen", effects=effects))
    return load_track_scenario(path)


def model_of(scenario: TrackScenario, stages: Mapping[str, Theta], **more: object) -> Model:
    """A model file's content: `stages` beyond the nominal one as changes of it."""
    base = believed_model(scenario, Theta()).theta
    values = {stage: base | stages.get(stage, Theta()) for stage in ("nominal", "calibrated", "augmented")}
    return Model(scenario.kind, values, "named", **more)  # type: ignore[arg-type]


def led(scenario: TrackScenario, model: Model, names: list[str] | None = None) -> Leading:
    usual = names or names_of(scenario.control.controller, scenario.kind, model)
    return chosen_of(
        model, Believed(partial(believed_model, scenario)), mission_of(scenario), usual, lambda words, share: None
    )


def error_m(scenario: TrackScenario, values: Theta, controller: str) -> float:
    return score(scenario, run_loop(scenario, believed_model(scenario, values), controller, 4)).tracking_rmse_m


@pytest.mark.slow
def test_the_mean_of_a_class_leads_where_each_member_loses_in_the_world_of_another(tmp_path: Path) -> None:
    """The drive lags in the plant's form, `sensor_delay` was named. The mean errs less than that, and no more than the
    other member, nominal model or PID.
    """
    scenario = scenario_of(tmp_path, LAG)
    base = believed_model(scenario, Theta()).theta
    delay, lag = Theta(effects={"sensor_delay": {"delay_s": 0.1}}), Theta(effects={"actuator_lag": {"time_s": 0.11}})
    both = Theta(effects={"sensor_delay": {"delay_s": 0.05}, "actuator_lag": {"time_s": 0.055}})
    told = {"nominal": "it errs ten times as much", "calibrated": "it errs ten times as much"}
    possible = {"actuator_lag": base | lag, "class": base | both}
    leading = led(scenario, model_of(scenario, {"augmented": delay}, refuted=told, possible=possible))
    assert leading.stage == "class"
    led_by = ("feedforward", "mpc")
    named, other, plain = (min(error_m(scenario, base | one, c) for c in led_by) for one in (delay, lag, Theta()))
    reached = error_m(scenario, leading.values, leading.controller)
    assert reached < 0.8 * named
    assert reached < WORSE * min(other, plain, error_m(scenario, base, "pid"))
    assert leading.chosen is not None
    assert "class" in leading.chosen.why


@pytest.mark.slow
def test_a_calibration_that_no_record_prefers_by_far_does_not_lead(tmp_path: Path) -> None:
    """Its friction is 40 % off, and the records leave the nominal model possible."""
    scenario = scenario_of(tmp_path, "")
    off = Theta({"friction_coefficient": 0.115, "magnet_stiffness_N_per_m": 20.0})
    model = model_of(scenario, {"calibrated": off, "augmented": off})
    nominal = model.stages["nominal"]
    model = replace(model, possible={"draw_1": nominal | {"friction_coefficient": 0.085}})
    leading = led(scenario, model)
    assert leading.stage == "nominal"
    worst = min(error_m(scenario, model.stages["calibrated"], name) for name in ("feedforward", "mpc"))
    assert error_m(scenario, leading.values, leading.controller) < 0.5 * worst


def test_a_barred_stage_is_no_candidate_and_the_reason_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = replace(scenario_of(tmp_path, ""), duration_s=1.0)
    parts = Theta(effects={"stenosis": {"depth": 3.0, "centre_m": 0.0, "width_m": 0.01}})
    why = {"augmented": "stenosis.depth is at its bound."}
    model = model_of(scenario, {"augmented": parts}, barred=why, possible={"draw_1": Theta()})
    leading = led(scenario, model, ["feedforward"])
    assert leading.stage == "nominal"
    assert leading.chosen is not None
    assert "augmented must not lead: stenosis.depth is at its bound." in leading.chosen.why
    assert set(leading.chosen.expected) == {"nominal"}
    assert values_of(Path("m.toml"), model, "augmented")[1] == "augmented"
    said = " ".join(capsys.readouterr().err.split())
    assert "m.toml: the augmented model must not lead as it is: stenosis.depth is at its bound." in said


def test_where_no_fit_may_lead_the_rig_file_leads_under_the_usual_controller(tmp_path: Path) -> None:
    """As close-loop writes it where it found nothing of what is missing."""
    scenario = replace(scenario_of(tmp_path, ""), duration_s=1.0)
    why = dict.fromkeys(("calibrated", "augmented"), "it makes up for something.")
    model = model_of(scenario, {"calibrated": Theta.of({"friction_coefficient": 0.12})}, barred=why, refuted=why)
    leading = led(scenario, replace(model, possible={}))
    assert leading.stage == "nominal"
    assert leading.chosen is not None
    assert set(leading.chosen.expected) == {"nominal"}
    assert leading.controller == scenario.control.controller
    again = Model.from_toml(replace(model, possible={}).to_toml())
    assert again.chooses
    assert not again.possible


def test_worlds_are_what_the_records_leave_possible(tmp_path: Path) -> None:
    scenario = scenario_of(tmp_path, "")
    more = Theta({"friction_coefficient": 0.09})
    model = model_of(scenario, {"augmented": more}, refuted={"calibrated": "-"})
    possible = {"class": Theta({"friction_coefficient": 0.085}), "draw_1": model.stages["augmented"], "draw_2": more}
    model = replace(model, possible=possible)
    assert list(worlds_of(model)) == ["augmented", "nominal", "draw_2"]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A scenario of 1 s, and a model that carries a choice."""
    scenario = scenario_of(tmp_path, "")
    path = tmp_path / "scenario.toml"
    path.write_text(
        path.read_text()
        .replace("duration_s = 5.0", "duration_s = 1.0")
        .replace("2.0, 2.5, 3.5, 5.0", "1.0")
        .replace("4.0, 4.0, 1.0, 5.0", "0.5")
    )
    nominal = believed_model(scenario, Theta()).theta
    model = model_of(scenario, {}, possible={"draw_1": nominal | {"friction_coefficient": 0.085}})
    file = tmp_path / "model.toml"
    file.write_text(model.to_toml())
    return path, file


def test_track_says_what_was_chosen(files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    scenario, model = files
    assert run(["track", str(scenario), "--model", str(model), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    chosen = found["chosen"]
    assert found["model"] == chosen["stage"] == "nominal"
    assert found["controller"] == chosen["controller"]
    assert chosen["expected_rmse_m"]["nominal"] > 0
    assert run(["track", str(scenario), "--model", str(model), "--controller", "feedforward"]) == 0
    assert "chosen: nominal with feedforward" in capsys.readouterr().out


def test_each_model_is_built_and_each_controller_asked_once(
    files: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The choice's models are those that lead and stand beside them; what was chosen may lead. The choice has tried
    feedforward and MPC with the stated localisation, so no other loop of them is run for that.
    """
    built, asked = list[Theta](), list[tuple[str, bool]]()

    def control_model_counted(rig: Rig, values: Theta, *more: Any, **named: Any) -> ControlModel:
        built.append(values)
        return control_model(rig, values, *more, **named)

    def unfit_counted(mission: Mission, model: ControlModel, controller: str, loops: bool) -> str:
        asked.append((controller, loops))
        return unfit(mission, model, controller, loops)

    monkeypatch.setattr(hil.app.track.loop, "control_model", control_model_counted)
    monkeypatch.setattr(hil.app.scenario.chosen, "unfit", unfit_counted)
    assert run(["track", str(files[0]), "--model", str(files[1])]) == 0
    assert [values for values in built if built.count(values) > 1] == []
    assert sorted(asked) == [("feedforward", False), ("mpc", False), ("pid", True)]


def test_a_controller_given_by_hand_is_refused_for_late_readings() -> None:
    """A PID behind a coil whose readings are 0.1 s late."""
    scenario = seen("coil", 100.0, 0.1)
    with pytest.raises(ValueError, match="faster or less late for pid"):
        led(scenario, model_of(scenario, {}), ["pid"])


def test_a_stage_given_by_hand_stands(files: tuple[Path, Path]) -> None:
    scenario, path = load_track_scenario(files[0]), files[1]
    usual = replace(scenario, control=scenario.control.but(controller="mpc"))
    asked = (usual, CATALOGUE, Believed(partial(believed_model, scenario)))
    leading = leading_of(path, "draw_1", None, *asked)
    assert (leading.stage, leading.controller, leading.chosen) == ("draw_1", "mpc", None)
    assert leading.values["friction_coefficient"] == 0.085
    assert leading.document() == {"beyond_records": {}}


def test_a_model_without_a_choice(files: tuple[Path, Path]) -> None:
    """Its last stage leads as before; asking for a choice is refused."""
    scenario, path = load_track_scenario(files[0]), files[1]
    path.write_text(replace(Model.from_toml(path.read_text()), possible={}).to_toml())
    usual = replace(scenario, control=scenario.control.but(controller="mpc"))
    asked = (usual, CATALOGUE, Believed(partial(believed_model, scenario)))
    assert leading_of(path, None, None, *asked).stage == "augmented"
    with pytest.raises(ValueError, match="must carry a choice"):
        leading_of(path, "chosen", None, *asked)
