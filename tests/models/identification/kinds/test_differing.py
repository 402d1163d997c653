"""Records of a series whose rig differs by what the rig file states of each."""

import tomllib
from typing import Any

import numpy as np
import pytest

from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.rig_texts import GUT

AXIS = {"rig": {"kind": "axis"}, "axis": {"mass_kg": 9.0, "viscous_friction_N_s_per_m": 30.0}}
HEAVIER = [{"file": "heavier.csv.gz", "axis": {"mass_kg": 14.0}}]


def stage(name: str, mass: float, seed: int) -> Record:
    rng, t = np.random.default_rng(seed), np.arange(0, 12, 2e-3)
    turns, sizes = 2 * np.pi * np.array([[0.31], [1.17]]), np.array([[0.05], [0.02]])
    x, v, a = (
        np.sum(sizes * turns**k * f(turns * t), axis=0)
        for k, f in ((0, np.sin), (1, np.cos), (2, lambda q: -np.sin(q)))
    )
    force = mass * a + 40.0 * v + 6.0 * np.sign(v) + 0.3 + 0.05 * rng.standard_normal(len(t))
    return Record(name, "axis", {"t_s": t, "position_m": x, "force_N": force})


@pytest.mark.parametrize(("record", "left"), [(HEAVIER, 1.5), (None, np.inf)])
def test_a_stated_difference_of_mass_is_no_error(record: list[dict[str, Any]] | None, left: float) -> None:
    records = [stage("light", 10.0, 1), stage("heavier", 15.0, 2)]
    kind = kind_for(parse_rig({**AXIS, **({"record": record} if record else {})}), records)
    fit = Fitter.of(kind, records, []).far([kind.nominal()])
    if record is None:
        assert fit.chi2 > 100
    else:
        assert fit.chi2 < left
        assert fit.theta["mass_kg"] == pytest.approx(10.0, rel=0.01)
        part = kind.splits(records)[0][1]
        assert all(np.mean(kind.residual(one, fit.theta) ** 2) < left for one in part)


def test_a_record_of_another_capsule_is_predicted_as_that_capsule() -> None:
    tables = {**tomllib.loads(GUT), "rig": {"kind": "pull"}, "noise": {"force_std_N": 1e-3}}
    wider = {"file": "wide.csv", "capsule": {"radius_m": 7.2e-3}, "tissue": {"friction_coefficient": 0.1}}
    t = np.arange(0, 6, 2e-3)
    columns = {"t_s": t, "position_m": 3e-3 * (1 - np.cos(2 * np.pi * t / 6)), "force_N": np.zeros_like(t)}
    narrow, wide = (Record(name, "pull", columns) for name in ("narrow", "series/wide"))
    both = kind_for(parse_rig({**tables, "record": [wider]}), [narrow, wide])
    alone = {
        "narrow": kind_for(parse_rig(tables), [narrow]),
        "wide": kind_for(parse_rig({k: {**v, **wider.get(k, {})} for k, v in tables.items()}), [wide]),  # type: ignore[dict-item]
    }
    theta = both.nominal() | Theta({"hoop_stress_factor": 1.2})
    for record, name in ((narrow, "narrow"), (wide, "wide")):
        own = alone[name].nominal() | Theta({"hoop_stress_factor": 1.2})
        assert both.predict(record, theta) == pytest.approx(alone[name].predict(record, own), abs=1e-9)
    assert not np.allclose(both.predict(narrow, theta), both.predict(wide, theta), atol=1e-4)


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({"axis": {"mass_kg": 1.0}}, "must have 'file'"),
        ({"file": "b.csv", "axis": {"mas_kg": 1.0}}, "mas_kg"),
        ({"file": "b.csv", "mass_kg": 1.0}, "as capsule.mass_kg"),
        ({"file": "b.csv", "rig": {"kind": "dma"}}, "kind must be that of the rig"),
    ],
)
def test_what_cannot_differ_is_told(record: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        parse_rig({"rig": {"kind": "axis"}, "record": [record]})
