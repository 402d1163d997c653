"""What noise alone leaves of a right model, which says when to look no further."""

import tomllib
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from models.identification.fitting.fit import judged_cost
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.screening import null_distribution, records_for_null
from models.identification.settings import SET
from models.records.record import Record, read_record
from models.rigs.reader import read_rig
from models.rigs.rig import Rig
from models.rigs.tables import Noise
from models.theta import Theta
from tests.plant.series import make_series


class Hanging(SeriesKind):
    """Imitates with a wall a fiftieth firmer than told, as a model does whose teeth hang on how finely it is
    computed.
    """

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """Slips a little later than `residual` will say."""
        return super().imitate(record, theta | {"hoop_stress_factor": 1.02 * theta["hoop_stress_factor"]}, rng)


def test_a_tooth_that_the_model_itself_misses_does_not_count_as_chance(tmp_path: Path) -> None:
    folder = make_series("magnetic", None, 3, tmp_path, 12.0)
    rig, answer = read_rig(folder / "rig.toml"), tomllib.loads((folder / "answer.toml").read_text(encoding="utf-8"))
    records = [read_record(folder / "train_1.csv.gz", rig)]
    plain = SeriesKind.from_rig(rig, records)
    kind = Hanging(**{f.name: getattr(plain, f.name) for f in fields(plain)} | {"effects": ()})
    truth = Theta.of((p.key, float(answer[p.name])) for p in kind.base if p.fit)
    assert judged_cost(kind, [kind.imitate(records[0], truth, np.random.default_rng(0))], truth) > 2.0
    assert null_distribution(kind, records, truth, np.random.default_rng(0))[1] < 1.2


def test_chance_is_told_from_enough_of_the_records(monkeypatch: pytest.MonkeyPatch) -> None:
    """A piece of a stage's motion goes one way only, in which an asymmetry is an offset; a second of a gut record is as
    little.
    """
    t = np.arange(0, 3 * SET.imitated_s, 1e-3)
    still = Record("made", "axis", {"t_s": t, "position_m": 0.05 * np.cos(2 * np.pi * t / 3), "force_N": np.sin(t)})
    part = AxisKind.from_rig(Rig("axis", noise=Noise(force_std_N=1.0))).splits([still])[0][0]
    assert records_for_null(AxisKind.from_rig(Rig("axis")), part) == part
    seconds = [still.beginning(share * SET.imitated_s) for share in (0.4, 0.6, 0.8, 1.0)]
    monkeypatch.setattr(AxisKind, "beginnings_s", SET.beginnings_s)
    assert len(records_for_null(AxisKind.from_rig(Rig("axis")), seconds)) == 3
    assert len(records_for_null(AxisKind.from_rig(Rig("axis")), seconds[::-1])) == 2
    assert len(records_for_null(AxisKind.from_rig(Rig("axis")), seconds[:1])) == 1
    (one,) = records_for_null(AxisKind.from_rig(Rig("axis")), [still])
    assert np.ptp(one["t_s"]) == pytest.approx(SET.imitated_s, rel=0.01), "chance shows in the beginning of a long one"
