"""Magnets and coils on a plate, in the air, in the gut, and pressing on the wall: series of the plant's own through the
loop's parts.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.effects import CATALOGUE
from models.identification.fitting.fit import judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from plant import layout as at
from plant.drives import TrueMagnet
from plant.rig import STEP_S, Plant, TruePlate, Truth
from tests.models.identification.search.test_vibro_search import read_series
from tests.plant.series import make_series


def left(folder: Path, *effects: str) -> tuple[float, Theta]:
    """What a joint fit of base and `effects` leaves of a record: its mean square in units of the noise; and the fit."""
    rig, records, _ = read_series(folder)
    full = kind_for(rig, records)
    assert isinstance(full, SeriesKind)
    kind = replace(full, effects=tuple(CATALOGUE[name] for name in effects))
    start = kind.nominal()
    for name in effects:
        start = start.with_(name, CATALOGUE[name].start()) | {
            (name, CATALOGUE[name].amplitude().name): CATALOGUE[name].probe
        }
    fitter = Fitter.of(kind, records[:1], effects)
    fit = fitter.exactly(fitter.far([start]).theta)
    return fit.chi2, fit.theta


@pytest.mark.parametrize("name", ["magnetic_plate", "coil_plate"])
def test_nothing_hidden_on_a_plate_leaves_noise(name: str, tmp_path: Path) -> None:
    assert left(make_series(name, None, 2, tmp_path, 5.0, rate_Hz=200.0))[0] < SET.near


@pytest.mark.parametrize("name", ["magnetic_plate", "coil_plate"])
def test_a_drag_on_a_plate_is_found(name: str, tmp_path: Path) -> None:
    folder = make_series(name, "viscous_drag", 2, tmp_path, 8.0, rate_Hz=200.0)
    without, with_drag = left(folder)[0], left(folder, "viscous_drag")[0]
    assert without > 3 * with_drag


def test_a_lag_before_a_coils_current_shows_in_records_of_its_voltage_alone(tmp_path: Path) -> None:
    by_current = make_series("coil", "actuator_lag", 3, tmp_path / "current", 4.0, rate_Hz=200.0)
    by_voltage = make_series("coil_voltage", "actuator_lag", 3, tmp_path / "voltage", 4.0, rate_Hz=200.0)
    assert left(by_current)[0] < SET.near
    without, (with_lag, fit) = left(by_voltage)[0], left(by_voltage, "actuator_lag")
    assert with_lag < SET.near < 0.5 * without
    assert 0.04 < fit["actuator_lag", "time_s"] < 0.2


def test_a_magnet_that_presses_the_capsule_on_the_wall_is_found(tmp_path: Path) -> None:
    """The plant's load is a dipole's; the catalogue's fall over the gap is another one."""
    folder = make_series("magnetic", "dipole_load", 3, tmp_path, 5.0, rate_Hz=200.0)
    without, (with_load, fit) = left(folder)[0], left(folder, "magnet_normal_load")
    assert without > 10 * with_load
    assert fit["magnet_normal_load", "load_N"] == pytest.approx(0.55, rel=0.3)


def test_a_magnet_swings_a_capsule_in_the_air() -> None:
    """Nothing but a drag damps it: stiffness and drag follow from the swing."""
    t = np.arange(0.0, 6.0, STEP_S)
    carriage = 2e-3 * np.sin(9 * t) + 3e-3 * np.sin(2 * t)
    drag = {"viscous_drag": {"force_N": 0.02}}
    rows = Plant(Truth(TrueMagnet(24.0), surface=TruePlate(0.0), hidden=drag)).advance(carriage, 250)
    place = rows[:, at.O_X] + 2e-5 * np.random.default_rng(1).standard_normal(rows.shape[0])
    rig = parse_rig(
        {
            "capsule": {"mass_kg": 4e-3},
            "rig": {"kind": "magnetic", "magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02},
            "surface": {"kind": "air"},
            "noise": {"position_std_m": 2e-5},
        }
    )
    columns = {"t_s": rows[:, at.O_T], "carriage_position_m": rows[:, at.O_DRIVE], "position_m": place}
    record = Record("swing", "magnetic", columns)
    kind = replace(kind_for(rig, [record]), effects=(CATALOGUE["viscous_drag"],))
    base = Fitter.of(kind, [record], []).far([kind.nominal()]).theta
    start = kind.nominal().with_("viscous_drag", CATALOGUE["viscous_drag"].start()) | {
        ("viscous_drag", "coefficient_N"): 0.01
    }
    fit = Fitter.of(kind, [record], ["viscous_drag"]).far([start]).theta
    assert judged_cost(kind, [record], fit) < SET.near < judged_cost(kind, [record], base)
    assert fit["magnet_stiffness_N_per_m"] == pytest.approx(24.0, rel=0.02)
