"""An accelerometer on the capsule beside slow images: what is read, what counts, and what images do not show."""

import numpy as np
import pytest

from hil.report.closed_loop import report_html
from hil.report.numbers import report_json
from models.identification import close
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.settings import SET
from models.records.record import Record, record_of
from models.rigs.columns import ACCELERATION
from models.rigs.rig import Rig
from plant.rig import Truth
from tests.bench.bench_two_columns import VIBRO, cost, kind_of, series


@pytest.fixture(scope="module")
def damped() -> tuple[Rig, list[Record], Truth]:
    return series(3.0)


def test_images_at_another_rate_than_the_accelerometer_make_one_record(
    damped: tuple[Rig, list[Record], Truth],
) -> None:
    rig, (record, *_), _ = damped
    assert len(record) == 1500
    kind = kind_for(rig, [record])
    assert kind.channels == ("position_m", ACCELERATION)
    nominal = kind.nominal()
    rows = {column: len(kind.alone(column).residual(record, nominal)) for column in kind.channels}
    assert rows == {"position_m": 15, ACCELERATION: 1500}
    both = kind.residual(record, nominal)
    np.testing.assert_array_equal(both, np.hstack([kind.alone(c).residual(record, nominal) for c in kind.channels]))


def test_the_accelerometer_is_no_part_of_what_drives() -> None:
    rig, (record, *_), _ = series(1.0, 1, hidden={})
    assert set(record.driven.columns) & {"position_m", ACCELERATION} == set()
    kind = kind_for(rig, [record]).alone(ACCELERATION)
    nominal = kind.nominal()
    moved = record.with_column(ACCELERATION, record[ACCELERATION][::-1])
    np.testing.assert_array_equal(kind.predict(record.driven, nominal), kind.predict(moved.driven, nominal))


def test_its_zero_is_unknown_and_gaps_do_not_count(damped: tuple[Rig, list[Record], Truth]) -> None:
    rig, (record, *_), _ = damped
    kind = kind_for(rig, [record]).alone(ACCELERATION)
    nominal, a = kind.nominal(), record[ACCELERATION]
    plain = kind.residual(record, nominal)
    tilted = kind.residual(record.with_column(ACCELERATION, a + 0.7), nominal)
    assert tilted == pytest.approx(plain, abs=1e-6)
    some = np.where(np.arange(len(a)) % 7 == 0, np.nan, a)
    assert len(kind.residual(record.with_column(ACCELERATION, some), nominal)) == int(np.isfinite(some).sum())


@pytest.mark.parametrize("wrong", [np.inf, 1e12])
def test_one_that_cannot_be_used_is_left_out_with_a_note(wrong: float) -> None:
    rig, (record, *_), _ = series(1.0, 1, hidden={})
    columns = {name: record[name] for name in ("t_s", "drive_on", "position_m")}
    read = record_of("run", {**columns, ACCELERATION: np.where(record["t_s"] < 0.1, wrong, 0.0)}, rig)
    assert ACCELERATION not in read.columns
    assert any(f"column {ACCELERATION} is left out" in note for note in read.notes)


def test_where_nothing_hides_a_calibration_leaves_little_of_either_column() -> None:
    """The sensor's filter has another form than the model's; both are late by 0.6 ms."""
    rig, records, truth = series(3.0, hidden={})
    kind = kind_of(rig, records)
    fit = Fitter.of(kind, records, []).far([kind.nominal()])
    for column in kind.channels:
        left = [kind.alone(column).residual(record, fit.theta, kind.final) for record in records]
        assert float(np.mean(np.concatenate(left) ** 2)) < 2
    assert fit.theta["friction_coefficient"] == pytest.approx(truth.tissue.friction_coefficient, rel=0.03)
    late = fit.theta["acceleration_clock_s"] + fit.theta["acceleration_lowpass_s"]
    assert late == pytest.approx(6e-4, abs=1e-4)


def test_it_shows_what_images_alone_do_not(damped: tuple[Rig, list[Record], Truth]) -> None:
    """Damping of the inner mass's spring: a calibration follows images of 0.5 mm as well as chance allows; beside the
    accelerometer it does not, and damping leaves the least by far.
    """
    rig, records, _ = damped
    images = [record.without([ACCELERATION]) for record in records]
    alone, both = kind_of(rig, images), kind_of(rig, records)
    assert cost(alone, images) < SET.near
    costs = {name: cost(both, records, name) for name in VIBRO.candidates}
    own = costs.pop("spring_damping")
    assert min(costs.values()) > 5 * own


def test_a_loop_reports_both_columns() -> None:
    """Errors, floor, checks, figures and the prediction, each by column."""
    rig, records, _ = series(3.0, 3, hidden={})
    finding, model = close(rig, records[:2], records[2:], lambda *_: None, most=0, drawn=False)
    error = report_json(finding)["error"]
    assert error["quantity"] == "position_m"
    beside = error["beside"][ACCELERATION]
    assert beside["error_unit"] == "m/s2"
    assert beside["error"]["holdout"]["calibrated"] < beside["error"]["holdout"]["nominal"]
    checks = {check.id for check in finding.checks}
    assert {"residual_size", f"residual_size.{ACCELERATION}", f"held_out.{ACCELERATION}"} <= checks
    page = report_html(finding)
    assert "acceleration in m" in page
    assert "held out, acceleration" in page
    predicted = model.predict(rig, records[2], "calibrated")
    off = records[2][ACCELERATION] - predicted[ACCELERATION]
    assert float(np.std(off)) == pytest.approx(beside["error"]["holdout"]["calibrated"], rel=1e-6)
