"""A load cell between drive and capsule beside images: what is read, what counts, and what the place does not show."""

import tomllib

import numpy as np
import pytest

from hil.report.closed_loop import report_html
from models.checks.examine import examine
from models.identification import Model, close
from models.identification.finding import Finding
from models.identification.kinds import kind_for
from models.identification.settings import SET
from models.records.record import Record, record_of
from models.rigs.columns import DRIVE_FORCE
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from tests.bench.bench_two_columns import COIL, MAGNET, Bench, cost, kind_of, series
from tests.rig_texts import GUT


def closed(records: list[Record], rig: Rig) -> Finding:
    return close(rig, records[:2], records[2:], lambda *_: None, most=1, drawn=False)[0]


def test_a_magnet_that_loses_its_grip_is_told_from_friction_that_grows() -> None:
    """The place alone leaves it open, as either explains a capsule that lags more; the force of the drive does not."""
    rig, records, _ = series(MAGNET.seconds, 3, MAGNET)
    alone, both = closed([record.without([DRIVE_FORCE]) for record in records], rig), closed(records, rig)
    assert alone.verdict == "unknown" or any(effect.equivalent for effect in alone.effects)
    assert (both.verdict, [(e.id, e.equivalent) for e in both.effects]) == ("named", [("coupling_fade", ())])
    beside = both.beside[DRIVE_FORCE]
    assert beside.error["holdout"]["augmented"] < 1.2 * beside.noise_floor < beside.error["holdout"]["calibrated"]
    assert {f"residual_size.{DRIVE_FORCE}", f"held_out.{DRIVE_FORCE}"} <= {check.id for check in both.checks}
    assert "drive force in " in report_html(both)


def test_where_nothing_hides_nothing_is_named() -> None:
    """One image off by 0.2 mm at the start is 5 mN of a magnet's force, and counts for no more than an image."""
    rig, records, _ = series(12.0, 3, MAGNET, {})
    assert closed(records, rig).verdict == "none"


def test_a_coil_that_fades_is_told_from_friction_that_grows() -> None:
    """Fits to images of 0.2 mm leave as much with either effect; beside a load cell they do not."""
    rig, records, _ = series(COIL.seconds, bench=COIL)
    images, pair = [record.without([DRIVE_FORCE]) for record in records], COIL.candidates[:2]
    fade, drying = (cost(kind_of(rig, images, pair), images, effect) for effect in pair)
    assert max(fade, drying) < 1.3 * min(fade, drying)
    fade, drying = (cost(kind_of(rig, records, pair), records, effect) for effect in pair)
    assert fade < SET.near
    assert drying > 5 * fade


@pytest.mark.parametrize("column", ["coil_current_A", "coil_voltage_V"])
def test_a_coil_pushes_with_its_current(column: str) -> None:
    """Behind its winding a voltage of 2 V is 0.2 A after some milliseconds, 0.1 N at 0.5 N/A."""
    coil = {"kind": "coil", "force_constant_N_per_A": 0.5, "coil_resistance_Ohm": 10.0, "coil_inductance_H": 0.01}
    rig = parse_rig({**tomllib.loads(GUT), "rig": coil, "surface": {"kind": "plate", "friction_coefficient": 5.0}})
    t = np.arange(0, 2, 2e-3)
    on = np.where(t < 1, 0.0, 0.2 if column == "coil_current_A" else 2.0)
    columns = {"t_s": t, column: on, "position_m": 0.0 * t, DRIVE_FORCE: np.sin(t)}
    record = record_of("run", columns, rig)
    kind = kind_for(rig, [record]).alone(DRIVE_FORCE)
    force = kind.predict(record.driven, kind.nominal())
    assert DRIVE_FORCE not in record.driven.columns
    assert force[t < 1] == pytest.approx(0.0, abs=1e-9)
    assert force[t > 1.02] == pytest.approx(0.1, rel=1e-3)


def test_a_magnet_pulls_by_its_gap_and_the_zero_of_the_cell_does_not_count() -> None:
    rig, (record,), _ = series(4.0, 1, MAGNET, hidden={})
    kind = kind_for(rig, [record])
    assert kind.channels == ("position_m", DRIVE_FORCE)
    place, cell, nominal = kind.alone("position_m"), kind.alone(DRIVE_FORCE), kind.nominal()
    gap = record["carriage_position_m"] - place.predict(record, nominal)
    pull = 25.0 * gap / (1 + (gap / 0.02) ** 2) ** 2
    assert cell.predict(record, nominal) == pytest.approx(pull, abs=5e-5)
    moved = record.with_column(DRIVE_FORCE, record[DRIVE_FORCE] + 0.3)
    assert cell.residual(moved, nominal) == pytest.approx(cell.residual(record, nominal), abs=1e-6)
    assert cell.unit == "N"


def test_a_model_found_with_the_column_serves_records_without_it() -> None:
    rig, (record,), _ = series(4.0, 1, MAGNET, hidden={})
    nominal = kind_for(rig, [record]).nominal()
    model = Model("magnetic", dict.fromkeys(("nominal", "calibrated", "augmented"), nominal), "none", {})
    bare = record.without([DRIVE_FORCE])
    for one, columns in ((record, {"t_s", "position_m", DRIVE_FORCE}), (bare, {"t_s", "position_m"})):
        model.check(rig, one)
        assert set(model.predict(rig, one)) == columns


@pytest.mark.parametrize("bench", [MAGNET, COIL], ids=["magnet", "coil"])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_cell_that_shows_the_reaction_is_told_with_the_line_that_turns_it(bench: Bench, seed: int) -> None:
    """The cell's zero, 0.3 N here, says nothing."""
    rig, (record, *_), _ = series(bench.seconds, seed, bench)
    cell = record[DRIVE_FORCE] + 0.3
    cell[::3] = np.nan
    found = {sign: examine(rig, [record.with_column(DRIVE_FORCE, sign * cell)]) for sign in (1, -1)}
    assert not [one for one in found[1] if one.id == "cell_sign"]
    (told,) = (one for one in found[-1] if one.id == "cell_sign")
    assert told.severity == "stops"
    assert "drive_force_N" in told.remedy
    assert "sign = -1" in told.remedy


def test_one_that_cannot_be_used_is_left_out_with_a_note() -> None:
    rig, (record,), _ = series(4.0, 1, MAGNET, hidden={})
    columns = {name: record[name] for name in ("t_s", "carriage_position_m", "position_m")}
    read = record_of("run", {**columns, DRIVE_FORCE: np.where(record["t_s"] < 0.1, np.inf, 0.0)}, rig)
    assert DRIVE_FORCE not in read.columns
    assert any(f"column {DRIVE_FORCE} is left out" in note for note in read.notes)
    assert kind_for(rig, [read]).channels == ("position_m",)
