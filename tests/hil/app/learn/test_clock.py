"""What goes on in time goes by the run's clock in every part of a run that is learned from, as in the controller."""

from dataclasses import replace

import numpy as np
import pytest

from hil.app.learn.identify import LEAD_S, _part
from models.checks.usable import counted
from models.identification.kinds import kind_for, ready
from models.records.record import Record
from models.rigs.columns import TIME
from tests.controller.loops import believed


@pytest.mark.parametrize(
    ("effect", "numbers"),
    [("respiration", {"force_N": 8e-3, "frequency_Hz": 0.3}), ("tissue_drying", {"rate_per_s": 0.01})],
)
def test_a_part_is_predicted_as_in_the_whole_run(effect: str, numbers: dict[str, float]) -> None:
    t = np.arange(0.0, 60.0, 0.01)
    rig, carriage = believed("magnetic"), 14e-3 * np.sin(2 * np.pi * 0.2 * t)
    run = Record("run", "magnetic", {TIME: t, "carriage_position_m": carriage, "position_m": 0.0 * t})
    kind = kind_for(rig, [])
    theta = kind.nominal().with_(effect, {**kind.catalogue[effect].start(), **numbers})
    columns = {**run.columns, "position_m": kind.predict(run, theta)}
    for begin, end in ((2000, 4500), (4500, None)):
        part = ready(_part("part", rig, columns, begin, end), rig)
        assert part.began_s == pytest.approx(t[begin] - LEAD_S)
        assert part[TIME][0] == 0.0
        off, begun_again = (
            np.std((kind.predict(one, theta) - part["position_m"])[counted(part)])
            for one in (part, replace(part, began_s=0.0))
        )
        assert off < 0.3 * begun_again
