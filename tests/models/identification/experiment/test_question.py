"""How far apart a motion puts two models that one pass cannot tell."""

from dataclasses import replace

import numpy as np
import pytest

from models.effects import CATALOGUE
from models.identification.experiment.plan import Move, Plan, Room
from models.identification.experiment.question import Candidate, Question, question
from models.identification.fitting.fit import Problem
from models.identification.kinds.series.series import SeriesKind
from models.identification.settings import SET
from models.records.record import Record
from models.rigs.rig import Rig
from models.rigs.tables import Noise

ROOM = Room("position_m", 0.0, 20e-3, 0.0, 8e-3, 10.0, 2e-3)
KIND = SeriesKind.from_rig(Rig("pull", noise=Noise(force_std_N=1e-3)), [])


def model(effect: str, amplitude: float) -> Candidate:
    name = CATALOGUE[effect].amplitude().name
    return Candidate(effect, (effect,), KIND.nominal().with_(effect, {**CATALOGUE[effect].start(), name: amplitude}))


TAPER, DRYING = model("lumen_taper", 15.0), model("tissue_drying", 0.15)


def one_pass() -> Record:
    t = np.arange(5001) * 2e-3
    driven = Record("pass", "pull", {"t_s": t, "position_m": 1e-3 * t})
    return KIND.imitate(driven, TAPER.theta, np.random.default_rng(0))


@pytest.fixture(scope="module")
def asked() -> Question:
    problem = Problem.of(KIND, [one_pass()], DRYING.effects, KIND.criteria - 1)
    rival = replace(DRYING, theta=problem.narrowing(DRYING.theta, SET.wide).theta)
    return question(KIND, [one_pass()], TAPER, rival, np.random.default_rng(0))


def test_a_return_tells_a_taper_from_drying_and_a_second_pass_does_not(asked: Question) -> None:
    again = Plan(ROOM, (Move(9.7e-3, 1e-3, 0.0),)).record("pull")
    back = Plan(ROOM, (Move(10e-3, 4e-3, 1.0), Move(0.0, 4e-3, 0.0))).record("pull")
    assert asked.separation(back) > 3 * asked.separation(again)
    assert asked.separation(back) > 10
    assert asked.apart["pass"] < asked.separation(back) / 3


def test_a_true_fit_promises_no_more(asked: Question) -> None:
    back = Plan(ROOM, (Move(10e-3, 4e-3, 1.0), Move(0.0, 4e-3, 0.0))).record("pull")
    assert 3 < asked.refitted([one_pass()], back) <= asked.separation(back)
