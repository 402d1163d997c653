"""Closing the loop: what is named on measured and on simulated data, and what is not."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.effects import CATALOGUE
from models.identification import Model, close
from models.identification.finding import Finding
from models.identification.model import HELD_OUT, sealed
from models.identification.verdict import WORSE
from models.laws.geometry import Capsule, Tissue
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig, read_rig
from models.rigs.rig import Rig
from models.sets import measured_path
from models.theta import Theta
from tests.rig_texts import GUT


def quiet(stage: str, fraction: float) -> None:
    assert 0 <= fraction <= 1
    assert stage


def closed(folder: Path) -> tuple[Finding, dict[str, object]]:
    """What the first halves of a series' records show, 20 to 27 s each."""
    rig = read_rig(folder / "rig.toml")
    whole = [read_record(folder / f"{name}.csv.gz", rig) for name in ("train_1", "train_2", "train_3", "holdout")]
    *train, held = (record.rows(slice(len(record) // 2)) for record in whole)
    finding, _ = close(rig, train, [held], quiet)
    return finding, tomllib.loads((folder / "answer.toml").read_text())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pull_none", "pull_wall_viscosity", "magnetic_none"])
def test_another_simulators_series(shared: Path, name: str) -> None:
    finding, answer = closed(shared / "reference" / "series" / name)
    effect = str(answer["effect"]).split(",")[0]
    if effect == "none":
        assert finding.verdict == "none"
        assert not finding.effects
        limit = 3 * finding.noise_floor
    else:
        assert finding.verdict == "named"
        assert finding.effects[0].id == effect
        assert len(finding.effects[0].equivalent) <= 2
        limit = 0.3 * finding.error["holdout"]["calibrated"]
    assert finding.error["holdout"]["augmented"] < limit
    for parameter in ("hoop_stress_factor", "friction_coefficient", "magnet_stiffness_N_per_m"):
        if parameter in answer:
            low, high = finding.calibration[parameter].ci95
            assert low <= float(str(answer[parameter])) <= high


def test_printed_periods_lack_small_strain_stiffening() -> None:
    rig = parse_rig({"rig": {"kind": "periods", "velocity_m_s": 0.5e-3}})
    finding, _ = close(rig, [read_record(measured_path("analytical_table2_periods"), rig)], [], quiet)
    assert [effect.id for effect in finding.effects] == ["small_strain_stiffening"]
    assert finding.effects[0].equivalent
    assert finding.next_experiment
    assert finding.error["train"]["augmented"] < 10 < finding.error["train"]["calibrated"]


def test_printed_moduli_stay_unknown() -> None:
    rig = parse_rig({"rig": {"kind": "dma"}})
    finding, _ = close(rig, [read_record(measured_path("viscoelastic_table2_dma"), rig)], [], quiet)
    assert finding.verdict == "unknown"
    assert finding.stopped == "no gain"
    assert not finding.effects
    assert finding.error["train"]["nominal"] == pytest.approx(99, abs=0.5)
    assert finding.error["train"]["calibrated"] == pytest.approx(14.2, abs=0.3)
    assert any("40 Hz" in statement for statement in finding.statements)


@pytest.mark.slow
def test_the_measured_axis_lacks_asymmetry(shared: Path) -> None:
    """In the first 7 s, about a stroke of four; `docs/results/identification.md` has the whole record."""
    rig = parse_rig({"rig": {"kind": "axis"}})
    train, held = (read_record(shared / "data" / "emps" / f"{name}.csv", rig) for name in ("train", "test_pulses"))
    finding, _ = close(rig, [train.rows(slice(7_000))], [held.rows(slice(7_000))], quiet)
    assert finding.effects[0].id == "directional_asymmetry"
    assert "stribeck" not in [effect.id for effect in finding.effects]
    assert finding.error_unit == "%"
    assert finding.error["train"]["calibrated"] == pytest.approx(3.95, abs=0.1)
    assert finding.error["holdout"]["calibrated"] == pytest.approx(6.12, abs=0.1)
    assert "sensor_delay" in [effect.id for effect in finding.effects]
    assert finding.error["holdout"]["augmented"] < 4.2
    assert finding.smallest_detectable["directional_asymmetry"] < 0.02  # it is 0.17


def short_pull(noise: float = 1e-3, hoop: float = 1.1, mu: float = 0.075, seed: int = 3) -> tuple[Rig, list[Record]]:
    from models.identification.kinds.series.series import SeriesKind

    rig = Rig("pull", Capsule(), Tissue())
    t = np.arange(0, 12, 2e-3)
    position = 6e-3 * (1 - np.cos(2 * np.pi * t / 6)) * 0.5
    blank = Record("pull", "pull", {"t_s": t, "position_m": position, "force_N": np.zeros_like(t)})
    kind = SeriesKind.from_rig(parse_rig(PULL), [blank])
    rng = np.random.default_rng(seed)
    truth = Theta({"hoop_stress_factor": hoop, "friction_coefficient": mu})
    return rig, [kind.imitate(blank, truth, rng), kind.imitate(blank, truth, rng)]


PULL = {**tomllib.loads(GUT), "rig": {"kind": "pull"}, "noise": {"force_std_N": 1e-3}}


def test_a_right_model_lacks_nothing_and_finds_its_numbers_again() -> None:
    _, records = short_pull()
    finding, model = close(parse_rig(PULL), records, [], quiet)
    assert finding.verdict == "none"
    assert finding.stopped == "noise"
    assert any(said.startswith("The search ended because what is left, ") for said in finding.statements)
    assert model.validity["x_m"] == pytest.approx((0, 6e-3), abs=1e-5)
    assert finding.calibration["hoop_stress_factor"].value == pytest.approx(1.1, rel=0.01)
    assert finding.calibration["friction_coefficient"].value == pytest.approx(0.075, rel=0.01)
    again, same = close(parse_rig(PULL), records, [], quiet)
    assert same == model
    assert again.error == finding.error


def test_none_of_records_that_show_only_much_of_an_effect_asks_for_a_record_that_shows_less() -> None:
    """A pull without a rest."""
    rig, (record, _) = parse_rig(PULL), short_pull()[1]
    finding, _ = close(rig, [record, replace(record, name="again")], [], quiet)
    assert finding.verdict == "none"
    assert finding.proposal is not None
    shown = finding.proposal.shows
    assert set(shown) & (finding.cannot_show.keys() | finding.smallest_detectable.keys())
    assert "or only more of it" in str(finding.next_experiment)


def test_a_model_tells_its_held_out_error_where_records_were_held_out() -> None:
    _, records = short_pull()
    finding, model = close(parse_rig(PULL), records[:1], records[1:], quiet)
    assert model.held_out == finding.error["holdout"]
    assert close(parse_rig(PULL), records, [], quiet)[1].held_out == {}


def test_a_prediction_never_sees_the_measurement() -> None:
    _, records = short_pull()
    values = Theta({"hoop_stress_factor": 1.0, "friction_coefficient": 0.08})
    model = Model("pull", dict.fromkeys(("nominal", "calibrated", "augmented"), values))
    spoiled = records[0].with_column("force_N", np.full(len(records[0]), 7.0))
    rig = parse_rig(PULL)
    np.testing.assert_array_equal(model.predict(rig, records[0])["force_N"], model.predict(rig, spoiled)["force_N"])


def test_a_model_survives_its_file() -> None:
    stage = Theta.of({"hoop_stress_factor": 1.0 / 3, ("stribeck", "excess"): 0.1, ("stribeck", "speed_m_s"): 1e-3})
    stages, told = {"nominal": Theta(), "calibrated": Theta(), "augmented": stage}, {"records": 'a "b"'}
    for held_out in ({}, {"nominal": 1e-3, "augmented": 1e-6 / 3}):
        model = Model("pull", stages, "named", told, held_out)
        assert Model.from_toml(model.to_toml()) == model
        assert model.believed("augmented") == stage | ({HELD_OUT: held_out["augmented"]} if held_out else {})


@pytest.mark.parametrize(
    "errors", ["augmentd = 1.0", "augmented = -1.0", "augmented = nan", "augmented = 'a'", "augmented = true"]
)
def test_a_held_out_error_is_a_number_of_a_stage(errors: str) -> None:
    text = Model("pull", dict.fromkeys(("nominal", "calibrated", "augmented"), Theta())).to_toml()
    with pytest.raises(ValueError, match=r"model.*\[held_out\]") as caught:
        Model.from_toml(sealed(f"{text}[held_out]\n{errors}\n"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "format = 1",
        'format = 1\nkind = "pull"\n[nominal]\nx = "a"\n[calibrated]\n[augmented]\n',
        "format = 2",
        "[",
        "kind = 3",
    ],
)
def test_a_bad_model_file_is_one_sentence(text: str) -> None:
    with pytest.raises(ValueError, match="model") as caught:
        Model.from_toml(text)
    assert "\n" not in str(caught.value)


def test_every_look_alike_is_told_apart_by_something() -> None:
    for effect in CATALOGUE.values():
        assert effect.separated_by, effect.id


def test_what_is_missing_beside_an_effect_with_held_parameters_is_screened() -> None:
    from models.identification.kinds.series.series import SeriesKind
    from models.identification.search.screening import screen

    _, records = short_pull()
    kind = SeriesKind.from_rig(parse_rig(PULL), records)
    values = {"hoop_stress_factor": 1.1, "friction_coefficient": 0.075}
    stribeck = {**CATALOGUE["stribeck"].start(), "excess": 0.1}
    rows = screen(kind, records[:1], ["stribeck"], Theta(values, {"stribeck": stribeck}))
    assert {row.effect for row in rows} == {effect.id for effect in kind.effects} - {"stribeck"}
    assert all(0 <= row.share <= 1 for row in rows)


def test_a_force_stamped_late_is_a_calibration_parameter_where_the_rig_file_says_so() -> None:
    _, records = short_pull()
    late = [r.with_column("force_N", np.interp(r["t_s"] - 0.02, r["t_s"], r["force_N"])) for r in records]
    finding, model = close(parse_rig({**PULL, "clock": {"offset_std_s": 0.02}}), late, [], quiet)
    assert finding.verdict == "none"
    assert finding.calibration["clock_offset_s"].value == pytest.approx(0.02, abs=2e-3)
    assert finding.calibration["hoop_stress_factor"].value == pytest.approx(1.1, rel=0.01)
    assert model.stages["nominal"]["clock_offset_s"] == 0.0
    known = close(parse_rig({**PULL, "clock": {"offset_s": 0.02}}), late, [], quiet)[0]
    assert (known.verdict, known.effects) == ("none", ())


def test_what_the_rig_file_says_of_a_nominal_value_holds_a_calibration_to_it() -> None:
    _, records = short_pull(noise=1e-3)
    short = [replace(record, columns={name: c[:600] for name, c in record.columns.items()}) for record in records]
    free, _ = close(parse_rig(PULL), short, [], quiet)
    held, _ = close(parse_rig({**PULL, "prior": {"hoop_stress_factor_std": 1e-4}}), short, [], quiet)
    assert abs(held.calibration["hoop_stress_factor"].value - 1) < 0.01
    assert abs(free.calibration["hoop_stress_factor"].value - 1) > 0.05
    known = close(parse_rig(PULL), short, [], quiet, known={"hoop_stress_factor": (1.2, 1e-4)})[0]
    assert abs(known.calibration["hoop_stress_factor"].value - 1.2) < 0.01
    with pytest.raises(
        ValueError, match=r"\[prior\] must name what calibration fits.*did you mean 'hoop_stress_factor'"
    ):
        close(parse_rig({**PULL, "prior": {"hoop_factor_std": 0.1}}), short, [], quiet)
    for bad in ({"hoop_stress_factor": 0.1}, {"hoop_stress_factor_std": 0.0}, {"hoop_stress_factor_std": "a"}):
        with pytest.raises(ValueError, match=r"\[prior\] must hold"):
            parse_rig({**PULL, "prior": bad})


def test_a_calibration_that_predicts_worse_than_nominal_is_told_in_report_and_model() -> None:
    _, records = short_pull()
    true = short_pull(hoop=1.0, mu=0.082)[1][1]
    finding, model = close(parse_rig(PULL), records[:1], [replace(true, name="held")], quiet)
    assert finding.error["holdout"]["calibrated"] > finding.error["holdout"]["nominal"]
    assert finding.findings[0].id == WORSE
    assert finding.verdict == "unknown"
    assert "worse than the nominal" in finding.reasons[0]
    assert set(model.cautions) == {"calibrated", "augmented"}
    assert Model.from_toml(model.to_toml()) == model


def test_records_that_tell_nothing_end_unknown_and_say_what_to_record() -> None:
    rng = np.random.default_rng(0)
    t = 0.01 * np.arange(400)
    columns = {"t_s": t, "position_m": 1e-3 * t}
    records = [
        Record(f"r{k}", "pull", {**columns, "force_N": 0.05 + 1e-3 * rng.standard_normal(400)}) for k in range(2)
    ]
    finding, _ = close(parse_rig(PULL), records, [], quiet)
    assert finding.verdict == "unknown"
    assert finding.stopped == "no gain"
    assert not finding.effects
    assert "does not respond to the motion" in finding.reasons[0]
    assert finding.next_experiment is not None
    assert "strokes in both directions" in finding.next_experiment
    start = next(f for f in finding.findings if f.id == "starts_in_motion")
    assert "at 1 mm/s" in start.sentence
