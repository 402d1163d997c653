"""A kind of rig that nobody here knows takes part once it is declared: read, checked, calibrated, its effect found,
reported, initialised, documented; and led, with one table in the controller and one in the plant.
"""

import re
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from controller.baselines import PID
from controller.drives import DRIVES as CONTROLLED
from controller.drives import Driven, envelope_of
from controller.estimator.cubature import CubatureEstimator
from controller.limits import Limits
from controller.model.control_model import control_model
from controller.reference import by_speeds
from controller.tuned import PidGains
from hil.api import identify
from hil.app.close_loop import result_files
from hil.app.init import init
from models.checks.examine import examine
from models.drives.drive import Drive
from models.identification.fitting.fitter import Fitter
from models.identification.kinds.series.series import SeriesKind
from models.laws.geometry import Capsule
from models.records.record import Record, read_record, record_of
from models.rigs.kinds import KINDS, SURFACES, drive_of, surface_of
from models.rigs.reader import parse_rig, read_rig
from models.rigs.rig import Rig
from plant.drives import DRIVES as SIMULATED
from plant.rig import Plant, TruePlate, Truth
from tests.controller.loops import closed_loop
from tests.hil.app.docs import keys
from tests.models.rigs.thruster import MASS_KG, MU, TABLES, THRUST, THRUSTER, JetTable, Slab, bursts
from tests.plant.force import Force

_HEAD = "| key | unit | range | default | meaning |\n| --- | --- | --- | --- | --- |\n"


class Jet(Force):
    """The simulated jet: a force, and a capsule that can be led."""

    free: ClassVar[bool] = True

    @property
    def command_scale(self) -> float:
        return THRUST


def _bounds(drive: Drive, limits: Limits) -> dict[str, float]:
    return {"low": -1.0, "high": 1.0, "rate": 1e3}


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    """A rig of the new kind, which its declaration, the surfaces' table, the controller's and the plant's know of."""
    monkeypatch.setitem(KINDS, THRUSTER.id, THRUSTER)
    monkeypatch.setitem(SURFACES, "plate", lambda rig: Slab(rig.capsule.mass_kg))
    monkeypatch.setitem(CONTROLLED, THRUSTER.id, Driven(name=THRUSTER.id, bounds=_bounds))
    monkeypatch.setitem(SIMULATED, THRUSTER.id, Jet)
    return parse_rig(TABLES)


def truth() -> Truth:
    """The simulated rig: another program, the same friction."""
    return Truth(SIMULATED["thruster"](), Capsule(mass_kg=MASS_KG), surface=TruePlate(MU))


def test_it_is_assembled_predicted_and_calibrated(rig: Rig) -> None:
    plant, every = Plant(truth()), 100
    t = plant.rig.step_s * np.arange(100_001)
    jet = 0.12 * np.sin(2 * np.pi * 2 * t)
    rows = plant.advance(THRUST * jet, every)
    place = np.interp(t[::every], rows[:, 0], rows[:, 1])
    record = Record("jet", "thruster", {"t_s": t[::every], "jet": jet[::every], "position_m": place})
    kind = SeriesKind.build(surface_of(rig), drive_of(rig), 1e-5, [record])
    fit = Fitter.of(kind, [record], [], kind.final).near(kind.nominal())
    assert fit.theta["thrust_N"] == pytest.approx(THRUST, rel=2e-3)
    assert np.std(kind.predict(record, fit.theta) - place) < 0.02 * np.std(place)


def test_its_file_is_read_and_what_is_wrong_is_said(rig: Rig) -> None:
    assert rig.own["jet"] == JetTable(thrust_N=1.0)
    wrong = {
        "table [jet] must be there for a rig of kind 'thruster'": {k: v for k, v in TABLES.items() if k != "jet"},
        "[jet] key must be a known one; got 'trust_N'; did you mean 'thrust_N'": TABLES | {"jet": {"trust_N": 1.0}},
        "[jet] must have the key 'thrust_N' (at least 1e-12": TABLES | {"jet": {}},
    }
    for sentence, tables in wrong.items():
        with pytest.raises(ValueError, match=re.escape(sentence)):
            parse_rig(tables)
    record = record_of("jet", bursts(np.random.default_rng(2), 2.0), rig)
    assert record.layout is THRUSTER.layout
    with pytest.raises(ValueError, match=r"jet must be between -1 \(back\) and 1 \(forth\); got 2"):
        record_of("jet", record.columns | {"jet": record["jet"] + 2.0}, rig)
    with pytest.raises(ValueError, match="got the columns of kind thruster"):
        record_of("jet", record.columns, parse_rig({"rig": {"kind": "friction"}}))


def test_its_effect_is_found_and_reported(rig: Rig) -> None:
    rows = [bursts(np.random.default_rng(seed), drag_N_s_per_m=0.5) for seed in (1, 2, 3)]
    records = [record_of(f"jet_{k}", columns, rig) for k, columns in enumerate(rows)]
    assert [one for one in examine(rig, records) if one.severity == "stops"] == []
    told = identify(rig, records[:2], records[2:])
    assert (told.finding.verdict, [one.id for one in told.finding.effects]) == ("named", ["viscous_drag"])
    page = str(result_files(told.finding, told.model)["report.html"])
    assert "thruster rig" in page
    assert "viscous_drag" in page


def test_it_is_initialised_and_documented(rig: Rig, tmp_path: Path) -> None:
    init(THRUSTER.id, tmp_path)
    assert read_rig(tmp_path / "rig.toml") == rig
    assert len(read_record(tmp_path / "record.csv", rig)) >= THRUSTER.layout.minimum
    assert "thrust_N = 1.0" in (tmp_path / "rig.toml").read_text(encoding="utf-8")
    assert "| `thruster` | `t_s`, `jet` | `position_m` | 100 |" in keys.columns()
    row = "| `thrust_N` | N | >= 1e-12, < 1e+09 | required | thrust of the jet where it is fully open |"
    assert f"### `[jet]`\n\n{_HEAD}{row}" in keys.rig_keys()


def test_it_is_led_in_closed_loop(rig: Rig) -> None:
    model = control_model(rig, {"thrust_N": THRUST}, 2e-3)
    envelope = envelope_of(model.drive)
    pid = PID(model, envelope, PidGains(20.0, 40.0, 1.0))
    reference = by_speeds([0.0, 5e-3], [0.2, 3.0])
    rows, commands, _, _ = closed_loop(model, [pid], reference, 3.0, truth(), CubatureEstimator(model))
    assert np.max(np.abs(commands)) <= 1.0
    assert rows[-1, 1] == pytest.approx(5e-3 * 2.8, abs=2e-3)


def test_a_kind_that_is_in_no_table_is_refused_with_those_that_are() -> None:
    with pytest.raises(ValueError, match="known: pull, magnetic, coil, vibro"):
        drive_of(Rig("thruster"))
    with pytest.raises(ValueError, match="must have the numbers of its drive"):
        drive_of(Rig("magnetic"))
