"""Which record of a series disagrees with the others, and by what."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from models.identification.disagreement import disagreements
from models.identification.finding import Disagreement
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.rig_texts import GUT

RIG = parse_rig(tomllib.loads(f'{GUT}\n[rig]\nkind = "pull"\n[noise]\nforce_std_N = 1e-3\n'))
TRUTH = Theta({"hoop_stress_factor": 1.1, "friction_coefficient": 0.075})
OFFSET_N = 3e-3


def told(own: Theta, others: Theta = TRUTH, seed: int = 0, odd: int = 2) -> tuple[Disagreement, ...]:
    """What is said of four pulls of which one has its `own` truth."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 12, 2e-3)
    blanks = []
    for k in range(4):
        far, turns = rng.uniform(1e-3, 4e-3, 3), rng.uniform(0.05, 0.25, 3)
        x = np.sum([a * (1 - np.cos(2 * np.pi * f * t)) for a, f in zip(far, turns, strict=True)], axis=0)
        blanks.append(Record(f"pull_{k}", "pull", {"t_s": t, "position_m": x, "force_N": np.zeros_like(t)}))
    kind = replace(kind_for(RIG, blanks), noise_std=1e-3)
    base = kind.nominal()
    records = [kind.imitate(b, base | (own if k == odd else others), rng) for k, b in enumerate(blanks)]
    kind = kind_for(RIG, records)
    plain = Fitter.of(kind, records, [])
    return disagreements(kind, plain.exactly(plain.far([base]).theta), [], records)


@pytest.mark.parametrize("seed", range(4))
def test_records_of_one_rig_agree(seed: int) -> None:
    assert told(TRUTH, seed=seed) == ()


def test_a_record_with_more_friction_is_named_with_how_much() -> None:
    (found,) = told(TRUTH | {"friction_coefficient": 0.075 * 1.15})
    assert (found.record, found.by) == ("pull_2", "friction_coefficient")
    assert found.shift == pytest.approx(0.15 * 0.075, rel=0.02)
    assert found.standard_deviations > 10


def test_a_record_under_a_load_of_its_own_is_named_with_the_load() -> None:
    """In a pull a constant force along the gut and an offset of the sensor are the same."""
    (found,) = told(TRUTH.with_("incline_gravity", {"force_N": OFFSET_N}), odd=0)
    assert found.record == "pull_0"
    assert found.by in ("incline_gravity", "sensor_bias")
    assert abs(found.shift) == pytest.approx(OFFSET_N, rel=0.05)
    assert found.unit == "N"
    assert found.ci95[0] <= found.shift <= found.ci95[1]


def test_what_all_records_lack_is_no_disagreement() -> None:
    drag = TRUTH.with_("incline_gravity", {"force_N": OFFSET_N})
    assert told(drag, drag) == ()
