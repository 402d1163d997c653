"""No candidate is named because its search was luckier, nor for what its refinement does."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from models.identification.fitting.fitter import Fitter
from models.identification.kind import Kind, Split
from models.identification.kinds import kind_for
from models.identification.search.candidates import Trial, from_the_best
from models.identification.search.fitted_model import FittedModel
from models.records.record import read_record
from models.rigs.reader import read_rig
from models.theta import Theta
from tests.plant.series import make_series

SECONDS = 12.0
LATE_S = 0.05


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> tuple[Kind, list[Split], dict[str, float]]:
    """Kind, splits and the true base of a series whose measurement is late."""
    folder = make_series("magnetic", "sensor_delay", 3, tmp_path_factory.mktemp("late"), SECONDS)
    rig = read_rig(folder / "rig.toml")
    records = [read_record(folder / f"train_{k}.csv.gz", rig) for k in (1, 2, 3)]
    kind = kind_for(rig, records)
    answer = tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    return kind, kind.splits(records), kind.nominal() | {k: v for k, v in answer.items() if k in kind.nominal()}


def test_a_stuck_look_alike_is_looked_for_from_the_best_ones_base(
    late: tuple[Kind, list[Split], dict[str, float]],
) -> None:
    kind, splits, base = late
    before = FittedModel.of(kind, splits, [], [base] * len(splits)).blocks
    lag = fitted(kind, splits, ["actuator_lag"], Theta.of({**base, ("actuator_lag", "time_s"): LATE_S}))
    stuck = [Theta.of({**base, "magnet_stiffness_N_per_m": 21.3, ("sensor_delay", "delay_s"): 0.02})] * len(splits)
    rows = [trial(kind, splits, before, "actuator_lag", lag), trial(kind, splits, before, "sensor_delay", stuck)]
    assert rows[1].gain < rows[0].gain
    best = max(
        from_the_best(FittedModel.of(kind, splits, [], [base] * len(splits)), rows, rows), key=lambda row: row.gain
    )
    assert best.effect == "sensor_delay"
    assert best.thetas[0]["sensor_delay", "delay_s"] == pytest.approx(0.048, abs=0.002)


def test_a_candidate_that_its_companion_made_needless_is_judged_alone(
    late: tuple[Kind, list[Split], dict[str, float]],
) -> None:
    kind, splits, base = late
    before = FittedModel.of(kind, splits, [], [base] * len(splits)).blocks
    model = ["actuator_lag", "sensor_delay"]
    lag = fitted(kind, splits, model[:1], Theta.of({**base, ("actuator_lag", "time_s"): LATE_S}))
    alone = trial(kind, splits, before, "actuator_lag", lag)
    both = fitted(
        kind, splits, model, Theta.of({**base, ("actuator_lag", "time_s"): 1e-4, ("sensor_delay", "delay_s"): LATE_S})
    )
    put_right = trial(kind, splits, before, "actuator_lag", both)
    helped = replace(alone, blocks=put_right.blocks, refinements={tuple(model): tuple(both)})
    rows = {
        row.effect: row
        for row in from_the_best(FittedModel.of(kind, splits, [], [base] * len(splits)), [alone], [helped])
    }
    assert rows["actuator_lag"] is alone
    assert rows["sensor_delay"].gain > alone.gain


def fitted(kind: Kind, splits: list[Split], model: list[str], start: dict[str, float]) -> list[dict[str, float]]:
    return [Fitter.of(kind, part, model).near(start).theta for part, _ in splits]


def trial(kind: Kind, splits: list[Split], before: np.ndarray, name: str, fits: list[dict[str, float]]) -> Trial:
    return Trial(name, tuple(fits), before, FittedModel.of(kind, splits, [], fits).blocks)
