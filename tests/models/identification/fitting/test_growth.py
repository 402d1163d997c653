"""A fit that begins with a few slip events: it finds the truth from far off."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from models.identification.fitting.fit import evaluate
from models.identification.fitting.fitter import Fitter, Growth
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.plant.series import make_series


def test_a_base_and_a_force_far_off_are_found(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 2, tmp_path, 30.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2)]
    kind = SeriesKind.from_rig(rig, records)
    nominal = Theta.declared(p for p in kind.base if p.fit)
    start = nominal | {("incline_gravity", "force_N"): 0.002}
    growth = Growth(Fitter.of(kind, records, ["incline_gravity"]), [start])
    theta = growth.over(records)
    assert growth.fits[0].chi2 < 1.1
    for name in nominal:
        assert theta[name] == pytest.approx(answer[str(name)], rel=0.01)
    mass_kg = 4.0e-3
    weight_N = -mass_kg * 9.81 * np.sin(answer["parameters"]["angle_rad"])
    assert theta["incline_gravity", "force_N"] == pytest.approx(weight_N, rel=0.02)


def test_it_never_ends_worse_than_where_it_was_told_to_start(tmp_path: Path) -> None:
    folder = make_series("magnetic", None, 3, tmp_path, 12.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / "train_1.csv.gz", rig)]
    kind = SeriesKind.from_rig(rig, records)
    truth = Theta.of((p.key, float(answer[p.name])) for p in kind.base if p.fit)
    r = evaluate(kind, records, truth, kind.free_run)
    growth = Growth(Fitter.of(kind, records, []), [truth])
    growth.over(records)
    assert growth.fits[0].cost <= float(r @ r)


def test_effects_that_a_model_has_are_fitted_with_its_base_and_are_no_candidates(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 1, tmp_path, 6.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / "train_1.csv.gz", rig)]
    plain = kind_for(rig, records)
    force_N = -4.0e-3 * 9.81 * np.sin(answer["parameters"]["angle_rad"])
    kind = kind_for(rig, records, {("incline_gravity", "force_N"): (0.8 * force_N, np.inf)})
    assert {e.id for e in plain.effects} - {e.id for e in kind.effects} == {"incline_gravity"}
    assert plain.predict(records[0], kind.nominal()) == pytest.approx(kind.predict(records[0], kind.nominal()))
    fitter = Fitter.of(kind, records, [])
    found = fitter.exactly(fitter.far([kind.nominal()]).theta)
    assert found.theta["incline_gravity", "force_N"] == pytest.approx(force_N, rel=0.05)


def test_a_base_that_is_known_is_left_as_it_is_however_much_it_leaves(tmp_path: Path) -> None:
    folder = make_series("magnetic", "incline_gravity", 2, tmp_path, 3.0)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / "train_1.csv.gz", rig)]
    kind = SeriesKind.from_rig(rig, records)
    known = replace(kind, base=tuple(replace(p, fit=False) for p in kind.base))
    fitter = Fitter.of(known, records, [])
    fit = fitter.exactly(fitter.far([known.nominal()]).theta)
    assert fit.chi2 > 10
    assert fit.theta == known.nominal()
    assert fit.jacobian.shape == (fit.count, 0)
