"""Each check finds what it is for, keeps still on a clean record, and says where and what to do."""

import tomllib
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show, inseparable
from models.checks.usable import cleaned, on_one_clock
from models.effects import CATALOGUE
from models.records.record import USED, Record, record_of
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from plant.experiments.examples import BELIEVED
from plant.experiments.profile import RandomRuns
from plant.experiments.scenario import RunTable, Scenario, record_scenario
from plant.sensing import Sensor
from tests.rig_texts import GUT

Array = NDArray[np.float64]
Columns = dict[str, Array]
RATE, SECONDS, NOISE = 200.0, 30.0, 1e-3


def pull(seed: int = 1, noise: float = NOISE) -> Columns:
    """Strokes to and fro at three speeds with rests; a friction loop with an elastic start, and white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, SECONDS, 1 / RATE)
    speed = np.zeros_like(t)
    starts = np.arange(1.0, SECONDS - 3, 4.0)
    for k, start in enumerate(starts):
        speed[(t >= start) & (t < start + 3)] = (-1) ** k * (1e-3, 4e-3, 2e-3)[k // 2 % 3]
    x = np.cumsum(speed) / RATE
    play, width = np.zeros_like(x), 0.4e-3
    for i in range(1, len(x)):
        play[i] = min(max(play[i - 1], x[i] - width), x[i] + width)
    force = 0.05 * (x - play) / width + 2 * speed
    return {"t_s": t, "position_m": x, "force_N": force + noise * rng.standard_normal(len(t))}


def record(columns: Columns) -> Record:
    return Record("one", "pull", columns)


def rig(**tables: object) -> Rig:
    return parse_rig({"rig": {"kind": "pull"}, "noise": {"force_std_N": NOISE}, **tomllib.loads(GUT), **tables})


def turned(c: Columns) -> Columns:
    return c | {"force_N": -c["force_N"]}


def clipped(c: Columns) -> Columns:
    return c | {"force_N": np.clip(c["force_N"], -0.051, 0.051)}


def constant(c: Columns) -> Columns:
    return c | {"force_N": 0.05 + NOISE * np.random.default_rng(0).standard_normal(len(c["t_s"]))}


def held(c: Columns) -> Columns:
    return c | {"force_N": np.repeat(c["force_N"][::7], 7)[: len(c["t_s"])]}


def coarse(c: Columns) -> Columns:
    return c | {"force_N": 8e-3 * np.round((c["force_N"] - 1e-4) / 8e-3)}


def spiked(c: Columns) -> Columns:
    force = c["force_N"].copy()
    force[[700, 2100, 4000]] += 0.2
    return c | {"force_N": force}


def humming(c: Columns) -> Columns:
    return c | {"force_N": c["force_N"] + 3e-3 * np.sin(2 * np.pi * 50 * c["t_s"])}


def filtered(c: Columns) -> Columns:
    clean, noise = pull(noise=0.0)["force_N"], c["force_N"] - pull(noise=0.0)["force_N"]
    return c | {"force_N": clean + np.convolve(noise, np.ones(4) / 2, mode="same")}


def noisy(c: Columns) -> Columns:
    return pull(noise=4 * NOISE)


def restarted(c: Columns) -> Columns:
    t = c["t_s"].copy()
    t[3000:] -= t[3000]
    return c | {"t_s": t}


def repeated(c: Columns) -> Columns:
    t = c["t_s"].copy()
    t[100] = t[99]
    return c | {"t_s": t}


def uneven(c: Columns) -> Columns:
    rng = np.random.default_rng(5)
    return c | {"t_s": c["t_s"] + 0.2 / RATE * rng.uniform(-1, 1, len(c["t_s"]))}


def with_gaps(c: Columns) -> Columns:
    kept = np.random.default_rng(5).random(len(c["t_s"])) > 0.02
    return {name: values[kept] for name, values in c.items()}


def paused(c: Columns) -> Columns:
    kept = np.abs(c["t_s"] - 10) > 1
    return {name: values[kept] for name, values in c.items()}


def late(c: Columns) -> Columns:
    return c | {"force_N": np.interp(c["t_s"] - 0.04, c["t_s"], c["force_N"])}


def drifting(c: Columns) -> Columns:
    return c | {"force_N": np.interp(c["t_s"] * (1 - 0.005), c["t_s"], c["force_N"])}


def in_grams(c: Columns) -> Columns:
    return c | {"force_N": c["force_N"] / 9.80665e-3}


def in_kiloseconds(c: Columns) -> Columns:
    return {**c, "t_s": 1e-3 * c["t_s"]}


def in_millimetres(c: Columns) -> Columns:
    return c | {"position_m": 1e3 * c["position_m"]}


def in_millinewtons(c: Columns) -> Columns:
    return c | {"force_N": 1e3 * c["force_N"]}


def in_motion(c: Columns) -> Columns:
    return {name: values[1900:] for name, values in c.items()}


def lost(c: Columns) -> Columns:
    return c | {"force_N": np.where((c["t_s"] > 12) & (c["t_s"] < 13), c["force_N"][2400], c["force_N"])}


def filled_in(c: Columns) -> Columns:
    t = c["t_s"]
    there = (t < 12) | (t > 20)
    return c | {"force_N": np.interp(t, t[there], c["force_N"][there])}


def no_answer(c: Columns) -> Columns:
    return c | {"force_N": np.where((c["t_s"] > 12) & (c["t_s"] < 12.04), -999.0, c["force_N"])}


def not_tared(c: Columns) -> Columns:
    return c | {"force_N": c["force_N"] + 0.2}


def in_steps(c: Columns) -> Columns:
    return c | {"position_m": np.round(c["position_m"], 4)}


def encoder_stuck(c: Columns) -> Columns:
    return c | {"position_m": np.where(c["t_s"] > 14, c["position_m"][2800], c["position_m"])}


def exchanged(c: Columns) -> Columns:
    return c | {"position_m": c["force_N"], "force_N": c["position_m"]}


def without_sign(c: Columns) -> Columns:
    return c | {"force_N": np.abs(c["force_N"])}


def twice_the_same(c: Columns) -> Columns:
    return c | {"force_N": np.round(3.1 * c["position_m"], 9)}


def backwards(c: Columns) -> Columns:
    return {name: values[::-1] for name, values in c.items()}


def not_connected(c: Columns) -> Columns:
    return c | {"force_N": np.full_like(c["force_N"], 0.04)}


CORRUPTIONS: dict[str, tuple[Callable[[Columns], Columns], str, str]] = {
    "the force's sign turned round": (turned, "force_sign", "stops"),
    "an amplifier that clips": (clipped, "clipping", "weakens"),
    "a constant and noise": (constant, "no_response", "weakens"),
    "values held for seven samples": (held, "held_values", "note"),
    "a coarse converter": (coarse, "resolution", "weakens"),
    "three spikes": (spiked, "outliers", "note"),
    "mains": (humming, "tone", "note"),
    "a sensor that filters": (filtered, "noise_coloured", "note"),
    "four times the stated noise": (noisy, "noise_stated", "note"),
    "a logger that began again": (restarted, "stamps_restart", "stops"),
    "a stamp that stands twice": (repeated, "stamps_repeated", "stops"),
    "uneven stamps": (uneven, "stamps_uneven", "note"),
    "missing samples": (with_gaps, "stamps_missing", "note"),
    "a pause": (paused, "pause", "weakens"),
    "a late force": (late, "clock_offset", "note"),
    "a force on a clock that runs slow": (drifting, "clock_drift", "weakens"),
    "grams for newtons": (in_grams, "force_size", "weakens"),
    "millimetres for metres": (in_millimetres, "units", "stops"),
    "seconds taken for milliseconds": (in_kiloseconds, "time_units", "weakens"),
    "millinewtons for newtons": (in_millinewtons, "units", "stops"),
    "a start in motion": (in_motion, "starts_in_motion", "note"),
    "a cable that was off for a second": (lost, "sensor_silent", "note"),
    "eight seconds filled in": (filled_in, "sensor_silent", "weakens"),
    "a logger's sign for no value": (no_answer, "no_values", "note"),
    "a load cell that was not set to zero": (not_tared, "zeros_apart", "note"),
    "a coarse encoder": (in_steps, "driven_resolution", "weakens"),
    "place and force in each other's column": (exchanged, "columns_exchanged", "stops"),
    "a force without its sign": (without_sign, "force_unsigned", "stops"),
    "one column logged twice": (twice_the_same, "columns_same", "stops"),
    "rows in reverse order": (backwards, "stamps_reversed", "stops"),
    "a sensor that is not connected": (not_connected, "no_response", "stops"),
    "an encoder that is stuck": (encoder_stuck, "driven_stuck", "weakens"),
}


@pytest.mark.parametrize("seed", range(5))
def test_a_clean_record_has_no_finding(seed: int) -> None:
    assert examine(rig(), [record(pull(seed))]) == ()


@pytest.mark.parametrize("what", CORRUPTIONS)
def test_each_corruption_is_found(what: str) -> None:
    corrupt, name, severity = CORRUPTIONS[what]
    found = {finding.id: finding for finding in examine(rig(), [record(corrupt(pull()))])}
    assert name in found, list(found)
    finding = found[name]
    assert finding.severity == severity
    assert finding.file == "one"
    assert finding.where
    assert finding.how
    assert finding.remedy
    if severity != "stops":
        assert stopping(tuple(found.values())) is None


@pytest.mark.parametrize(
    ("drifts", "found"), [((1, 1, 1), 3), ((1, 1, 0), 2), ((1, 0, 0), 0), ((1, -1), 0), ((1, 0), 1)]
)
def test_clocks_drift_in_all_records_alike(drifts: tuple[int, ...], found: int) -> None:
    records = []
    for seed, way in enumerate(drifts):
        c = pull(seed)
        records.append(record(c | {"force_N": np.interp(c["t_s"] * (1 - 0.005 * way), c["t_s"], c["force_N"])}))
    assert [finding.id for finding in examine(rig(), records)].count("clock_drift") == found


def test_a_clock_that_drifts_is_put_right_as_the_rig_file_says() -> None:
    spoiled = record(drifting(pull()))
    told = next(finding for finding in examine(rig(), [spoiled]) if finding.id == "clock_drift")
    clock = tomllib.loads(told.remedy.replace("[clock] ", "").replace(", ", "\n"))
    assert clock["drift"] == pytest.approx(0.005, abs=5e-4)
    assert clock["offset_s"] == pytest.approx(0.0, abs=4 * clock["offset_std_s"])
    ours = rig(clock={**clock, "offset_s": 0.0, "drift": 0.005})
    assert "clock_drift" not in {finding.id for finding in examine(ours, [spoiled])}
    right, whole = on_one_clock(spoiled, ours), pull()
    assert np.array_equal(right["force_N"], spoiled["force_N"])
    moved = np.interp(right["t_s"], whole["t_s"], whole["position_m"])
    assert right["position_m"] == pytest.approx(moved, abs=1e-12)
    ideal = np.interp(right["t_s"], whole["t_s"], whole["force_N"])
    assert np.sqrt(np.mean((right["force_N"] - ideal) ** 2)) < NOISE
    once = cleaned(spoiled, ours)
    assert once.treated
    assert "clock" in once.treated[0]
    assert cleaned(once, ours) is once
    early = on_one_clock(spoiled, rig(clock={"drift": -0.01}))
    assert early["t_s"][-1] <= spoiled["t_s"][-1] < 1.01 * early["t_s"][-1] + 0.1
    with pytest.raises(ValueError, match=r"\[clock\] drift must be left out for kind coil"):
        rig(rig={"kind": "coil", "force_constant_N_per_A": 0.5}, noise={}, clock={"drift": 0.01})


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [0.2, 0.5, 0.99])
def test_a_column_with_empty_cells_is_looked_at_where_it_has_values(seed: int, share: float) -> None:
    columns = pull(seed)
    some = np.random.default_rng(seed).random(len(columns["t_s"])) < share
    some[::5] = True
    made = record_of("one", columns | {"force_N": np.where(some, columns["force_N"], np.nan)}, rig())
    assert {finding.id for finding in examine(rig(), [made])} == {"sparse_values"}
    np.testing.assert_array_equal(cleaned(made, rig())[USED], some)


@pytest.mark.parametrize("swings", [1, 3])
def test_an_axis_that_friction_holds_is_not_taken_for_a_stuck_encoder(swings: int) -> None:
    """At a turning point its force goes once from one break-away to the other; to and fro it goes where it moves."""
    rng = np.random.default_rng(4)
    t = np.arange(0, 20, 1 / RATE)
    speed = np.where(t < 8, 5e-3, np.where(t < 12, 0.0, -5e-3))
    held = np.cos(np.pi * swings * np.clip((t - 8) / 4, 0, 1))
    force = np.where(t < 8, 1.0, np.where(t < 12, held, -1.0)) + 1e-3 * rng.standard_normal(len(t))
    axis = Record("one", "axis", {"t_s": t, "position_m": np.cumsum(speed) / RATE, "force_N": force})
    found = {finding.id for finding in examine(parse_rig({"rig": {"kind": "axis"}}), [axis])}
    assert ("driven_stuck" in found) == (swings > 1)


@pytest.mark.parametrize("corrupt", [turned, not_tared])
def test_a_remedy_keeps_what_the_rig_file_says_of_the_column(corrupt: Callable[[Columns], Columns]) -> None:
    ours = {
        "t_s": {"column": "time", "unit": "s"},
        "position_m": {"column": "x", "unit": "mm"},
        "force_N": {"column": "cell", "unit": "gf", "sign": -1, "offset": 3.0},
    }
    made = corrupt(pull())
    raw = {"time": made["t_s"], "x": 1e3 * made["position_m"], "cell": 3.0 - made["force_N"] / 9.80665e-3}
    mapped = rig(columns=ours)
    told = next(f for f in examine(mapped, [record_of("one", raw, mapped)]) if "[columns]" in f.remedy)
    line = told.remedy.split(", or swap")[0].split(", if")[0].removeprefix("[columns] ")
    mended = rig(columns=ours | tomllib.loads(line))
    assert told.id not in {f.id for f in examine(mended, [record_of("one", raw, mended)])}


@pytest.mark.parametrize(("size", "unit", "wrap"), [(2 * np.pi, None, 2 * np.pi), (360.0, "deg", 360.0)])
def test_an_angle_that_begins_again_is_read_as_it_went_with_the_line_that_is_told(
    size: float, unit: str | None, wrap: float
) -> None:
    rng = np.random.default_rng(4)
    t = np.arange(0, 20, 1 / RATE)
    angle = 9 * np.sin(0.5 * t) + np.sin(1.7 * t)
    torque = 0.3 * np.sign(np.gradient(angle)) + 1e-3 * rng.standard_normal(len(t))
    wrapped = np.mod(angle / (2 * np.pi) * size + size / 2, size) - size / 2
    columns = {"t_s": t, "angle_rad": wrapped, "torque_N_m": torque}
    table = {"angle_rad": {"column": "angle_rad", "unit": unit}} if unit else {}
    axis = parse_rig({"rig": {"kind": "axis"}, "columns": table})
    (told,) = (f for f in examine(axis, [record_of("one", columns, axis)]) if f.severity == "stops")
    assert told.id == "place_wraps"
    mended = parse_rig({"rig": {"kind": "axis"}, **tomllib.loads(told.remedy.replace("[columns] ", "[columns]\n"))})
    read = record_of("one", columns, mended)
    assert read["angle_rad"] - read["angle_rad"][0] == pytest.approx(angle - angle[0], abs=1e-9)
    assert stopping(examine(mended, [read])) is None
    steps = {**columns, "angle_rad": np.sign(np.sin(t))}
    assert "place_wraps" not in {
        f.id for f in examine(axis, [record_of("one", steps, parse_rig({"rig": {"kind": "axis"}}))])
    }


def test_on_a_plate_no_effect_of_a_living_wall_can_show() -> None:
    names = {"stress_relaxation", "respiration", "peristaltic_wave"}
    effects = [effect for effect in CATALOGUE.acting_on("coil") if effect.id in {*names, "stribeck"}]
    t = np.arange(0, 12, 5e-3)
    x = 5e-3 * np.sin(t) + 1e-3 * np.sin(3.1 * t)
    coil = Record("one", "coil", {"t_s": t, "coil_current_A": np.cos(t), "position_m": x})
    tables = {"rig": {"kind": "coil", "force_constant_N_per_A": 0.5}, **tomllib.loads(GUT)}
    plate = {"surface": {"kind": "plate", "friction_coefficient": 0.2}}
    assert not names & cannot_show(parse_rig(tables), [coil], effects).keys()
    assert names == cannot_show(parse_rig({**tables, **plate}), [coil], effects).keys()


def test_an_accepted_check_weakens_and_no_longer_stops() -> None:
    findings = examine(rig(checks={"accept": ["force_sign"]}), [record(turned(pull()))])
    assert stopping(findings) is None
    assert next(f for f in findings if f.id == "force_sign").severity == "weakens"


def test_clipped_and_spiked_samples_do_not_count() -> None:
    for corrupt in (clipped, spiked):
        made = corrupt(pull())
        rows = cleaned(record(made), rig())[USED] == 0
        differ = made["force_N"] != pull()["force_N"]
        assert rows[differ].all()
        assert rows.sum() <= 1.05 * differ.sum() + 2


def test_a_step_or_a_pulse_is_no_outlier() -> None:
    made = pull()
    force = made["force_N"].copy()
    force[1000:1030] += 0.2 * np.exp(-np.arange(30) / 8)
    force[3000:] += 0.1
    found = {finding.id for finding in examine(rig(), [record(made | {"force_N": force})])}
    assert "outliers" not in found


def test_motion_at_one_speed_and_one_way_cannot_show_what_needs_more() -> None:
    t = np.arange(0, 8, 1 / RATE)
    rng = np.random.default_rng(2)
    x = 2e-3 * t
    force = 0.05 * (1 - np.exp(-t / 0.2)) + NOISE * rng.standard_normal(len(t))
    hidden = cannot_show(rig(), [record({"t_s": t, "position_m": x, "force_N": force})], CATALOGUE.acting_on("pull"))
    assert "one speed" in hidden["stribeck"]
    assert "one direction" in hidden["directional_asymmetry"]
    assert "folds" not in hidden


def passing(speed: float, turning: bool = False) -> Record:
    """One pass at one speed, or there and back."""
    t = np.arange(0, 8, 1 / RATE)
    x = speed * np.where((t > 4) & turning, 8 - t, t)
    return record(
        {"t_s": t, "position_m": x, "force_N": 0.05 + NOISE * np.random.default_rng(3).standard_normal(len(t))}
    )


def test_on_one_pass_at_one_speed_what_goes_with_the_place_goes_with_time() -> None:
    effects, once = CATALOGUE.acting_on("pull"), passing(2e-3)
    for records in ([once], [once, once]):
        classes = inseparable(rig(), records, effects)
        assert "tissue_drying" in classes["lumen_taper"]
        assert "lumen_taper" in classes["tissue_drying"]
        assert "stribeck" not in classes
    for records in ([once, passing(1e-3)], [passing(2e-3, turning=True)]):
        assert inseparable(rig(), records, effects) == {}


def test_what_was_not_measured_does_not_count_and_a_coarse_encoder_is_smoothed() -> None:
    for corrupt in (lost, no_answer):
        rows = cleaned(record(corrupt(pull())), rig())[USED] == 0
        differ = corrupt(pull())["force_N"] != pull()["force_N"]
        assert np.mean(rows[differ]) > 0.98
        assert rows.sum() <= differ.sum() + 2
    smooth = cleaned(record(in_steps(pull())), rig())["position_m"]
    assert np.std(smooth - pull()["position_m"]) < 0.7 * np.std(in_steps(pull())["position_m"] - pull()["position_m"])


def test_a_coarse_encoder_is_no_late_force() -> None:
    assert "clock_offset" not in {finding.id for finding in examine(rig(), [record(in_steps(pull()))])}


def test_friction_that_follows_the_speed_is_no_early_force() -> None:
    t = np.arange(0, 24, 1 / RATE)
    x = 5e-3 * (1 - np.cos(2 * np.pi * t / 8))
    noise = np.random.default_rng(4).standard_normal((2, len(t)))
    force = 0.05 * np.tanh(np.gradient(x, t) / 2e-4) + NOISE * noise[0]
    columns = {"t_s": t, "position_m": x + 1e-6 * noise[1], "force_N": force}
    assert "clock_offset" not in {finding.id for finding in examine(rig(), [record(columns)])}
    columns["force_N"] = np.interp(t - 0.04, t, force)
    assert "clock_offset" in {finding.id for finding in examine(rig(), [record(columns)])}


def test_a_column_without_noise_may_rest() -> None:
    c = pull(noise=0.0)
    assert "sensor_silent" not in {finding.id for finding in examine(rig(), [record(c)])}


@pytest.mark.parametrize("seconds", [0.0, 0.2, 1.0])
def test_a_fast_motion_does_not_hide_a_sensor_that_holds_its_value(seconds: float) -> None:
    c = pull()
    t = c["t_s"]
    c["force_N"] = c["force_N"] + 0.05 * np.sin(2 * np.pi * 20 * t)
    c["force_N"][np.abs(t - t[len(t) // 2]) < seconds / 2] = c["force_N"][len(t) // 2]
    assert ("sensor_silent" in {finding.id for finding in examine(rig(), [record(c)])}) == bool(seconds)


def led(lag: float = 0.6e-3, offset: float = 0.0, jump: float = 0.0) -> Record:
    """A magnet that leads a capsule to and fro `lag` behind it."""
    c = pull()
    speed = np.gradient(c["position_m"])
    behind = np.zeros_like(speed)
    for i in range(1, len(behind)):
        behind[i] = min(max(behind[i - 1] + speed[i], -lag), lag)
    noise = 5e-5 * np.random.default_rng(4).standard_normal(len(speed))
    place = c["position_m"] - behind + offset + noise + np.where(c["t_s"] > 17, jump, 0.0)
    columns = {"t_s": c["t_s"], "carriage_position_m": c["position_m"], "position_m": place}
    return Record("one", "magnetic", columns)


def of_magnet(made: Record) -> dict[str, str]:
    magnetic = {"kind": "magnetic", "magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02}
    return {f.id: f.sentence for f in examine(rig(rig=magnetic, noise={"position_std_m": 5e-5}), [made])}


def test_places_that_count_from_elsewhere_jump_or_are_exchanged() -> None:
    assert of_magnet(led()) == {}
    assert "mm ahead of carriage_position_m" in of_magnet(led(offset=0.013))["zeros_apart"]
    assert "jumps by 1" in of_magnet(led(jump=0.015))["place_jumps"]
    made = led()
    exchanged = {**made.columns, "position_m": made["carriage_position_m"], "carriage_position_m": made["position_m"]}
    assert "exchanged" in of_magnet(Record("one", "magnetic", exchanged))["columns_exchanged"]


@pytest.mark.parametrize(
    ("scale", "found"),
    [(1.0, ""), (-1.0, "force_sign"), (1e3, "force_size"), (0.02, "force_size"), (1e6, "force_size units")],
)
def test_a_coils_current_drives_the_motion_with_as_much_as_holds_the_capsule(scale: float, found: str) -> None:
    c = pull()
    noise = 2e-5 * np.random.default_rng(5).standard_normal(len(c["t_s"]))
    columns = {"coil_current_A": 2 * scale * c["force_N"], "position_m": c["position_m"] + noise}
    coil = rig(rig={"kind": "coil", "force_constant_N_per_A": 0.5}, noise={"position_std_m": 2e-5})
    told = {f.id: f.sentence for f in examine(coil, [Record("one", "coil", {"t_s": c["t_s"], **columns})])}
    assert set(told) == set(found.split())
    assert "sign of coil_current_A" in told.get("force_sign", "sign of coil_current_A")


@pytest.mark.parametrize("seconds", [0.0, 0.2])
def test_a_localisation_whose_clock_drifts_is_told(seconds: float) -> None:
    t = np.arange(0, 40, 1 / RATE)
    turns = 2 * np.pi * np.array([[0.21], [0.53]])
    carriage = np.sum([[6e-3], [2e-3]] * np.sin(turns * t), axis=0)
    behind = np.zeros_like(t)
    for i in range(1, len(t)):
        behind[i] = min(max(behind[i - 1], carriage[i] - 1e-3), carriage[i] + 1e-3)
    place = np.interp(t - seconds * t / t[-1], t, behind) + 5e-5 * np.random.default_rng(3).standard_normal(len(t))
    told = of_magnet(Record("one", "magnetic", {"t_s": t, "carriage_position_m": carriage, "position_m": place}))
    assert ("clock_drift" in told) is bool(seconds)


@pytest.mark.parametrize(("kind", "seed"), [("magnetic_plate", 20), ("magnetic", 23), ("magnetic", 29)])
def test_a_short_clean_record_has_no_drifting_clock(kind: str, seed: int) -> None:
    """A rig of the plant in strokes of 8 to 20 s in all: few slips move whole strokes in time."""
    believed, rng = BELIEVED[kind], np.random.default_rng([4242, seed])
    truth, seconds, rate_Hz = believed.truth(rng), float(rng.uniform(8, 20)), float(rng.choice([100, 200, 250, 500]))
    run = RunTable("", round(seconds, 2), int(rng.integers(2**31)), truth.step_s)
    columns = record_scenario(Scenario(run, "magnetic", truth, RandomRuns(), Sensor(rate_Hz, 5e-5)), rng)
    assert examine(parse_rig(believed.tables()), [Record("one", "magnetic", columns)]) == ()


@pytest.mark.parametrize(("column", "scale"), [("position_m", 10.0), ("position_m", 0.1), ("carriage_position_m", 0.1)])
def test_a_capsule_that_follows_goes_as_far_as_its_magnet(column: str, scale: float) -> None:
    made = led()
    wide = made.with_column("carriage_position_m", 10 * made["carriage_position_m"])
    wide = wide.with_column("position_m", 10 * made["position_m"])
    assert "units" not in of_magnet(wide)
    assert "times as far" in of_magnet(wide.with_column(column, scale * wide[column]))["units"]


def test_a_capsule_that_hangs_behind_its_magnet_at_the_start_is_run_in() -> None:
    whole = led()
    assert "starts_in_motion" not in of_magnet(whole)
    resting = whole.rows(slice(int(np.searchsorted(whole["t_s"], 8.3)), None))
    assert abs(resting["carriage_position_m"][40] - resting["carriage_position_m"][0]) < 1e-5
    assert "under the load of an earlier motion" in of_magnet(resting)["starts_in_motion"]


def test_the_resistance_that_a_pull_has_at_rest_is_no_load_of_an_earlier_motion() -> None:
    c = pull()
    c["force_N"] = np.where(c["t_s"] < 1.0, 0.8 * np.abs(c["force_N"]).max(), c["force_N"])
    assert "starts_in_motion" not in {finding.id for finding in examine(rig(), [record(c)])}


def test_magnets_too_near_to_be_dipoles_are_told() -> None:
    t = np.arange(0, 10, 1 / RATE)
    carriage = 0.02 * np.sin(t)
    near = {"outer_remanence_T": 1.3, "outer_diameter_m": 0.1, "outer_length_m": 0.1, "inner_remanence_T": 1.2}
    near |= {"inner_diameter_m": 8e-3, "inner_length_m": 12e-3}
    made = {"t_s": t, "carriage_position_m": carriage, "position_m": 0.9 * carriage}
    for height, told in ((0.08, True), (0.15, False)):
        paired = rig(rig={"kind": "magnetic", "magnet": {**near, "height_m": height}}, noise={})
        findings = [f for f in examine(paired, [Record("r", "magnetic", made)]) if f.id == "near_magnets"]
        assert bool(findings) == told
        assert all("too strong" in finding.sentence and "from 130 mm on" in finding.sentence for finding in findings)


@pytest.mark.parametrize("hertz", [50.0, 60.0])
def test_mains_below_the_noise_are_told_at_rest(hertz: float) -> None:
    c, size = pull(), 0.7 * NOISE
    hum = size * np.sin(2 * np.pi * hertz * c["t_s"])
    (found,) = [f for f in examine(rig(), [record(c | {"force_N": c["force_N"] + hum})]) if f.id == "tone"]
    frequency, _, amplitude = found.sentence.rpartition(": ")[2].partition(" Hz (")
    assert float(frequency) == pytest.approx(hertz, rel=0.01)
    assert 1e-6 * float(amplitude.partition(" µN")[0]) == pytest.approx(size, rel=0.3)


def test_a_record_says_what_cleaning_did_to_it() -> None:
    made = pull()
    made["force_N"][[700, 1900]] += 5.0
    made["position_m"][1200] += 0.05
    assert cleaned(record(pull()), rig()).treated == ()
    left_out, straightened = cleaned(record(made), rig()).treated or ()
    assert left_out.startswith(f"2 of {len(made['t_s'])} values of force_N do not count")
    assert straightened.startswith("1 value of position_m is straight")
