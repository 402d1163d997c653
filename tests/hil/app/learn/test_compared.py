"""A learned model is offered only where it tracks better than nominal and PID in what the records leave possible."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from controller.choice.trial import Mission
from controller.choice.world import Localisation
from controller.limits import Limits
from controller.reference import through
from hil.app.learn import identify
from hil.app.learn.compared import Led, compared
from hil.app.learn.identify import LearningQuestion, answer
from models.identification import Model
from models.identification.kinds import kind_for
from models.rigs.columns import TIME
from models.theta import Theta
from tests.controller.loops import believed

RIG = believed("magnetic")
NOMINAL = kind_for(RIG, []).nominal()
FOLDS = NOMINAL | Theta(effects={"fold_periodic": {"depth": 0.3, "wavelength_m": 0.0073, "phase_rad": 0.4}})
LED = Led(Mission(through([12e-3], 3e-3, 0.5, 0.5), 5.0, Limits(), Localisation(std_m=0.1e-3)), "feedforward", 2e-3)


def learned(**possible: Theta) -> Model:
    """Folds that were learned, and what else the records leave possible."""
    stages = {"nominal": NOMINAL, "calibrated": NOMINAL, "augmented": FOLDS}
    return Model("magnetic", stages, "named", possible=possible, held_out={"augmented": 1e-4})


def test_a_model_that_tracks_best_where_it_is_right_leads() -> None:
    found = compared(LED, RIG, learned(), "augmented")
    assert (found.stage, found.controller) == ("augmented", "feedforward")
    assert found.expected["augmented"] < 0.7 * found.expected["nominal"]


def test_a_model_that_loses_where_nominal_is_as_possible_is_not_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folds may as well be elsewhere: there they track worse than the model without them."""
    finding = SimpleNamespace(
        effects=[SimpleNamespace(id="fold_periodic")],
        error={"holdout": {"augmented": 0.0}},
        verdict="named",
        next_experiment=None,
        proposal=None,
        seconds=1.0,
        unit="m",
    )
    model = replace(learned(draw_1=NOMINAL), held_out={})
    monkeypatch.setattr(identify, "close", lambda *_, **__: (finding, model))
    t = np.arange(0.0, 4.0, 0.01)
    columns = {TIME: t, "carriage_position_m": 1e-3 * t, "position_m": 1e-3 * t}
    question = LearningQuestion(RIG, columns, 300, Theta())
    assert answer(question).passed
    assert "not compared" in answer(question).sentence
    lost = answer(replace(question, led=LED))
    assert not lost.passed
    assert lost.sentence.startswith("in simulation another tracks better: nominal")
