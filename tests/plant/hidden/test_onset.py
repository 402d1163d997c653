"""An effect that has an onset is not there before it, and from it on is as from the beginning of a run."""

import numpy as np
import pytest

from plant import layout as at
from plant.drives import TrueMagnet
from plant.hidden.registry import ROWS
from plant.hidden.table import begun, effect_table
from plant.rig import STEP_S, Plant, Truth
from plant.sensing import Instrument
from plant.session import Instruments, Session
from plant.tables import Floats

RAMP: Floats = np.arange(round(2.0 / STEP_S) + 1, dtype=np.float64) * (2e-3 * STEP_S)
ONSET = 1.0


def path(hidden: dict[str, dict[str, float]], parts: int = 1) -> Floats:
    plant = Plant(Truth(TrueMagnet(), hidden=hidden))
    size = (RAMP.size - 1) // parts
    rows = [plant.advance(RAMP[k * size : (k + 1) * size + 1], 50) for k in range(parts)]
    return np.concatenate(rows)


@pytest.mark.parametrize("effect", ["fold_periodic", "carriage_backlash", "actuator_lag", "incline_gravity"])
def test_nothing_before_the_onset_in_one_go_or_in_many(effect: str) -> None:
    plain, late = path({}), path({effect: {"onset_s": ONSET}})
    before = plain[:, at.O_T] < ONSET - 1e-9
    assert np.array_equal(plain[before], late[before])
    assert np.max(np.abs(plain - late)[~before, at.O_X]) > 5e-5
    assert np.array_equal(late, path({effect: {"onset_s": ONSET}}, 4))


def test_what_passes_with_time_counts_from_the_onset() -> None:
    late = path({"tissue_drying": {"excess": 0.5, "time_s": 0.5, "onset_s": ONSET}})
    plain = path({})
    just = np.abs(late[:, at.O_T] - ONSET) < 0.02
    assert np.max(np.abs(late - plain)[just, at.O_X]) < 2e-4
    assert plain[-1, at.O_X] - late[-1, at.O_X] > 3e-4


def test_a_sensors_delay_and_offset_begin_late_too() -> None:
    quiet = Instruments(Instrument(std=0.0, latency_s=0.0))
    readings = {}
    for name in ("", "sensor_delay", "sensor_bias", "sensor_lowpass"):
        session = Session(Truth(TrueMagnet(), hidden={name: {"onset_s": ONSET}} if name else {}), quiet)
        found = [r for k in range(200) for r in session.advance(2e-5 * k, 0.01 * (k + 1))]
        readings[name] = np.array([(r.stamp_s, r.value) for r in found if r.channel == "position_m"])
    plain = readings.pop("")
    for values in readings.values():
        off = np.abs(values - plain)[:, 1]
        assert np.all(off[plain[:, 0] < ONSET - 1e-6] == 0)
        assert np.max(off[plain[:, 0] > ONSET]) > 2e-5


def test_a_table_of_what_has_begun() -> None:
    table = effect_table({"stribeck": {"onset_s": 2.0}, "added_mass": {}})
    now = begun(table, 1.0)
    assert now[ROWS["stribeck"], 0] == 0
    assert now[ROWS["added_mass"], 0] == table[ROWS["added_mass"], 0] > 0
    assert np.array_equal(begun(table, 2.0), table)


@pytest.mark.parametrize("onset", [-1.0, np.inf, np.nan])
def test_impossible_onsets_are_refused(onset: float) -> None:
    with pytest.raises(ValueError, match=r"effects\.stribeck\.onset_s must be zero or more"):
        effect_table({"stribeck": {"onset_s": onset}})
