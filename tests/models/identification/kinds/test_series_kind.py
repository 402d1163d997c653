"""Coil and vibro time series: what a switch's samples mean, which drive a record has, and free runs that follow the
plant.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.compiled.residuals import in_time
from models.drives.coil import Coil, VoltageCoil
from models.drives.vibro import RatedVibro, Vibro, VoltageVibro
from models.effects import CATALOGUE
from models.formula import line_text
from models.identification import Model
from models.identification.fitting.fit import judged_cost
from models.identification.kinds import kind_for
from models.identification.kinds.reports import series as report
from models.identification.kinds.series.drive_input import (
    SWITCH_DELAY,
    Feed,
    driven_column,
    feed,
    logged_whole,
    switched,
)
from models.identification.kinds.series.series import SeriesKind
from models.laws.geometry import Capsule
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.surfaces.surface import Plate
from models.theta import Theta
from plant.drives import TrueCoil, TrueVibro
from plant.experiments.examples import BELIEVED
from plant.experiments.profile import RandomPulses, pulse_width
from plant.experiments.scenario import RunTable, Scenario, record_scenario
from plant.rig import TruePlate, Truth
from plant.sensing import Sensor
from tests.bench.bench_drives import believed, series

FINE_S = 2e-5


def sampled(drive: np.ndarray, every: int) -> np.ndarray:
    """A switch's samples: the mean over the interval before each."""
    return np.append(drive[0], drive.reshape(-1, every).mean(axis=1))


@given(period_s=st.floats(0.02, 0.1), duty=st.floats(0.15, 0.85))
def test_edges_between_samples_are_put_back(period_s: float, duty: float) -> None:
    """500 Hz samples of a pulse-width modulated switch give its course in steps of 50 us, but for the steps that hold
    an edge.
    """
    drive = pulse_width(period_s, duty, 1.0, FINE_S)[:50_000]
    got, true = switched(sampled(drive, 100), 2e-3, 40, 0.0), drive[:50_000].reshape(-1, 5)[: 500 * 20].mean(axis=1)
    halves = got.reshape(-1, 2).mean(axis=1)
    assert halves.mean() == pytest.approx(true.mean(), abs=1e-9)
    apart = (halves - true)[:-20]  # what follows the last sample is unknown, so an edge before it too
    assert np.sum(np.abs(apart)) * 1e-4 < 2e-4 * (1 + 2 / period_s)
    assert np.max(np.abs(np.cumsum(apart))) * 1e-4 < 1.1e-4


def test_a_level_between_on_and_off_is_held_as_it_is() -> None:
    np.testing.assert_allclose(switched(np.full(20, 0.4), 2e-3, 10, 0.0), 0.4)
    level = np.r_[np.zeros(5), np.full(10, 0.4), np.ones(5)]
    assert switched(level, 2e-3, 4, 0.0).reshape(-1, 4)[8] == pytest.approx(0.4)


def test_a_switch_logged_as_on_or_off_may_act_later() -> None:
    command = np.r_[0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    assert logged_whole(command)
    np.testing.assert_allclose(switched(command, 2e-3, 2, 0.0), [0, 0, 1, 1, 1, 1, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(switched(command, 2e-3, 2, 1e-3), [0, 0, 0, 1, 1, 1, 1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(switched(command, 2e-3, 2, 2e-3), [0, 0, 0, 0, 1, 1, 1, 1, 0, 0], atol=1e-12)


def test_the_loop_s_own_intervals_meet_the_samples() -> None:
    t = 2e-3 * np.arange(50)
    record = Record("r", "vibro", {"t_s": t, "drive_on": (np.arange(50) % 10 < 3).astype(float), "position_m": t})
    fed = feed(Vibro(), record, False, 0.0)
    assert fed.dt * fed.every == pytest.approx(2e-3)
    spread = in_time(t, np.zeros(1), len(fed.commands), fed.first, fed.every)[:, 0]
    np.testing.assert_allclose(fed.samples(spread), t, atol=1e-12)
    np.testing.assert_allclose(np.diff(spread)[1:-1], fed.dt, atol=1e-12)
    assert len(fed.samples(fed.commands)) == 50
    assert Feed(t, 2e-3, 4).samples(t).shape == t.shape


def test_a_record_s_column_settles_the_drive() -> None:
    table = {"t_s": 2e-3 * np.arange(200), "position_m": np.zeros(200)}
    by = {name: Record(name, "vibro", {**table, name: np.zeros(200)}) for name in ("drive_on", "coil_voltage_V")}
    raw = believed("vibro_plate")
    rig = parse_rig({**raw, "drive": {**raw["drive"], "rated_voltage_V": 12.0}})
    assert type(SeriesKind.from_rig(rig, [by["drive_on"]]).drive) is Vibro
    assert type(SeriesKind.from_rig(rig, [by["coil_voltage_V"]]).drive) is RatedVibro
    with pytest.raises(ValueError, match="must have the key 'rated_voltage_V', or"):
        SeriesKind.from_rig(parse_rig(raw), [by["coil_voltage_V"]])
    with pytest.raises(
        ValueError, match=r"must have one driven column.*drive_on: drive_on, coil_voltage_V: coil_voltage_V"
    ):
        SeriesKind.from_rig(rig, list(by.values()))
    coil = parse_rig(believed("coil"))
    both = Record("both", "coil", {**table, "coil_voltage_V": np.zeros(200), "coil_current_A": np.zeros(200)})
    assert driven_column("coil", [both]) == "coil_current_A"
    assert type(SeriesKind.from_rig(coil, [both]).drive) is Coil
    assert type(SeriesKind.from_rig(coil, [both.without(("coil_current_A",))]).drive) is VoltageCoil


def test_a_plate_has_no_effects_of_a_wall() -> None:
    kind = SeriesKind.build(Plate(0.193), Vibro(), 5e-5)
    offered = {effect.id for effect in kind.effects}
    assert {"spring_damping", "end_stop_impact", "stribeck", "incline_gravity"} <= offered
    assert not offered & {"wall_viscosity", "small_strain_stiffening", "exponential_recovery"}
    assert offered < {effect.id for effect in CATALOGUE.values() if "vibro" in effect.kinds}


@pytest.mark.parametrize(("name", "share"), [("coil", 2e-3), ("vibro_plate", 1e-3), ("vibro_gut", 5e-3)])
def test_at_the_plant_s_numbers_a_free_run_follows_it(name: str, share: float) -> None:
    """Two programs for one physics, from the record's columns alone: what differs (the plant's own step of 20 us in the
    gut most of all) stays within `share` of the way; nominal numbers, some 7 to 15 % off, leave more than five times
    that.
    """
    rig, records, truth = series(name, None, 3, 6.0, 1)
    kind = kind_for(rig, records)
    way = float(np.ptp(records[0]["position_m"]))
    theta = kind.nominal() | truth | ({SWITCH_DELAY: 0.0} if rig.kind == "vibro" else {})
    left = kind.error(records, [kind.predict(records[0], theta)])
    assert left < share * way
    assert kind.error(records, [kind.predict(records[0], kind.nominal())]) > max(5 * left, share * way)
    assert float(np.mean(kind.residual(records[0], theta, 2) ** 2)) < 5


def test_a_shaken_second_half_goes_on_from_the_first() -> None:
    """Shaken in mid-record, the inner mass is not at rest where the second half begins: at the plant's numbers what is
    left of it is noise from its first block on.
    """
    rig, records, truth = series("vibro_plate", None, 3, 4.0, 1)
    kind = kind_for(rig, records)
    assert isinstance(kind, SeriesKind)
    theta = kind.nominal() | truth | {SWITCH_DELAY: 0.0}
    ((_, held_out),) = kind.splits(records)
    left = kind.residual(held_out[0], theta, kind.final)
    assert len(left) == len(records[0]) - len(records[0]) // 2
    assert float(np.mean(left[:50] ** 2)) < 5


@pytest.mark.parametrize(
    ("effect", "numbers"),
    [
        ("tissue_drying", {"rate_per_s": 0.02}),
        ("coupling_fade", {"rate_per_s": 0.02}),
        ("preconditioning", {"fall": 0.4, "length_m": 0.05}),
        ("respiration", {"force_N": 8e-3, "frequency_Hz": 0.33}),
    ],
)
def test_behind_a_magnet_what_goes_on_in_time_goes_on_in_the_second_half(
    effect: str, numbers: dict[str, float]
) -> None:
    """The only record is halved: its second half begins neither dry nor rested, and is predicted as in the whole."""
    rig = parse_rig(BELIEVED["magnetic"].tables(1.0))
    t = np.arange(0.0, 20.0, 5e-3)
    carriage = 8e-3 * np.sin(2 * np.pi * 0.25 * t)
    blank = Record("led", "magnetic", {"t_s": t, "carriage_position_m": carriage, "position_m": 0.0 * t})
    template = kind_for(rig, [])
    theta = template.nominal().with_(effect, {**template.catalogue[effect].start(), **numbers})
    made = template.imitate(blank, theta, np.random.default_rng(1))
    kind = kind_for(rig, [made])
    ((_, held),) = kind.splits([made])
    assert judged_cost(kind, held, theta) < 1.5
    assert judged_cost(kind, held, kind.nominal()) > 5
    late = made.rows(slice(len(made) // 2, None))
    assert late.began_s == pytest.approx(10.0)
    if effect != "preconditioning":  # which goes by the way, and a part knows its own alone
        there = kind.predict(made, theta)[len(made) // 2 :]
        off, begun_again = (
            np.std((kind.predict(one, theta) - there)[400:]) for one in (late, replace(late, began_s=0.0))
        )
        assert off < 0.3 * begun_again


def test_a_model_file_predicts_from_the_driven_column_alone() -> None:
    rig, records, truth = series("vibro_plate", None, 2, 3.0, 1)
    kind = kind_for(rig, records)
    assert isinstance(kind, SeriesKind)
    stage = kind.nominal() | truth
    model = Model("vibro", dict.fromkeys(("nominal", "calibrated", "augmented"), stage))
    record = records[0]
    seen = model.predict(rig, record)["position_m"]
    np.testing.assert_array_equal(
        model.predict(rig, record.with_column("position_m", np.ones(len(record))))["position_m"], seen
    )
    np.testing.assert_array_equal(model.predict(rig, record.without(("position_m",)))["position_m"], seen)
    moved = record.with_column("position_m", record["position_m"] + 0.13)
    assert kind.predict(moved, stage) == pytest.approx(kind.predict(record, stage) + 0.13, abs=1e-9)


@pytest.mark.parametrize("name", ["coil", "vibro_gut"])
def test_lost_and_late_samples_cost_little(name: str) -> None:
    rig, records, truth = series(name, None, 3, 4.0, 1)
    kind, rng = kind_for(rig, records), np.random.default_rng(0)
    theta = kind.nominal() | truth | ({SWITCH_DELAY: 0.0} if rig.kind == "vibro" else {})
    kept = np.sort(rng.permutation(len(records[0]))[: round(0.97 * len(records[0]))])
    lossy = records[0].rows(kept)
    whole, thinned = kind.predict(records[0], theta)[kept], kind.predict(lossy, theta)
    assert np.sqrt(np.mean((thinned - whole) ** 2)) < 0.02 * np.ptp(whole)
    assert thinned.shape == lossy["t_s"].shape


def test_a_coil_on_board_that_is_driven_by_voltage_follows_the_plant() -> None:
    coil = TrueCoil(0.5, 10.0, 0.05, 1.0, 0.5)
    truth = Truth(TrueVibro(0.01, 150.0, 0.3, coil=coil), Capsule(mass_kg=0.02), surface=TruePlate(0.29))
    run = Scenario(RunTable("", 4.0, 5), "vibro", truth, RandomPulses(0.05, amplitude_V=8.0), Sensor(500.0, 5e-5))
    record = Record("r", "vibro", record_scenario(run))
    drive = {
        "inner_mass_kg": 0.01, "spring_stiffness_N_per_m": 150.0, "spring_damping_N_s_per_m": 0.3, "force_N": 0.4,
        "reaction_on_body": True, "force_constant_N_per_A": 0.5, "coil_resistance_Ohm": 10.0, "coil_inductance_H": 0.05,
        "current_limit_A": 1.0,
    }  # fmt: skip
    surface = {"kind": "plate", "friction_coefficient": 0.29}
    rig = parse_rig({"capsule": {"mass_kg": 0.02}, "drive": drive, "surface": surface, "rig": {"kind": "vibro"}})
    kind = SeriesKind.from_rig(rig, [record])
    assert type(kind.drive) is VoltageVibro
    left = kind.error([record], [kind.predict(record, kind.nominal() | {SWITCH_DELAY: 0.0})])
    assert left < 5e-3 * np.ptp(record["position_m"])
    assert any("L i'" in line_text(line) for line in report.equations(kind, Theta()))


def test_a_prediction_that_runs_away_costs_much_and_warns_of_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = SeriesKind.build(Plate(0.193), Vibro(), 5e-5)
    record = Record("r", "vibro", {"t_s": 2e-3 * np.arange(4), "drive_on": np.zeros(4), "position_m": np.zeros(4)})
    monkeypatch.setattr(SeriesKind, "_runs", lambda *_, **__: np.array([[np.nan, np.inf, -1e306, 0.0]]))
    left = kind.residual(record, Theta(), 0)
    assert np.isfinite(left).all()
    assert np.min(np.abs(left[:3])) > 1e3


def test_a_further_record_is_asked_for_only_where_effects_are_alike() -> None:
    """Folds that are named alone need no record that separates them; with a rival, it is the rival that is named."""
    kind = kind_for(parse_rig(BELIEVED["pull"].tables()), [])
    folds = kind.nominal() | Theta.of({("fold_periodic", "depth"): 0.2})
    assert report.next_experiment(kind, folds, [], {"fold_periodic": ()}) is None
    said = str(report.next_experiment(kind, folds, [], {"fold_periodic": ("respiration",)}))
    assert "from a breathing force" in said
