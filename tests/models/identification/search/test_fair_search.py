"""No candidate is named because its search was luckier, nor for what another one does."""

import tomllib

import pytest

from models.identification.kinds import kind_for
from models.identification.search.candidates import Trial, compare_candidates, fair
from models.identification.search.fitted_model import FittedModel
from models.identification.search.screening import screen
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.plant.series import make_series

SECONDS = 12.0
LATE_S = 0.05
LAG = Theta.of({("actuator_lag", "time_s"): LATE_S})


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> FittedModel:
    """A series whose measurement is late, and its true base on every split."""
    folder = make_series("magnetic", "sensor_delay", 3, tmp_path_factory.mktemp("late"), SECONDS)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2, 3)]
    kind = kind_for(rig, records)
    answer = tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    base = kind.nominal() | {k: v for k, v in answer.items() if k in kind.nominal()}
    splits = kind.splits(records)
    return FittedModel(kind, splits).fitted([base] * len(splits))


def test_a_stuck_look_alike_is_looked_for_from_the_best_ones_base(late: FittedModel) -> None:
    base = late.thetas[0]
    lag = Trial("actuator_lag", late.near([base | LAG] * len(late.splits), ["actuator_lag"]), late.blocks)
    off = base | {"magnet_stiffness_N_per_m": 21.3, ("sensor_delay", "delay_s"): 0.02}
    stuck = Trial("sensor_delay", late.fitted([off] * len(late.splits), ["sensor_delay"]), late.blocks)
    assert stuck.gain < lag.gain
    trials, _ = fair(late, [lag, stuck])
    same, again = sorted(trials, key=lambda trial: trial.effect)
    assert again.fitted.cost < lag.fitted.cost
    assert again.fitted.thetas[0]["sensor_delay", "delay_s"] == pytest.approx(0.048, abs=0.002)
    assert same.fitted.thetas == lag.fitted.thetas


def test_a_candidate_does_not_lead_by_what_a_look_alike_beside_it_does(late: FittedModel) -> None:
    """A lag and a delay together explain what the delay alone does."""
    rows = [
        row
        for row in screen(late.kind, late.part, [], late.thetas[0])
        if row.effect in ("actuator_lag", "sensor_delay")
    ]
    trials, _ = fair(late, compare_candidates(late, rows, lambda name, share: None))
    assert trials[0].effect == "sensor_delay"
    assert trials[0].fitted.thetas[0]["sensor_delay", "delay_s"] == pytest.approx(0.048, abs=0.002)
    assert all(trial.gain < trials[0].gain - 0.1 for trial in trials[1:])
