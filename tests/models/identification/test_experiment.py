"""The next record: it shows what the records so far do not, and separates two models that one pass does not."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from hil.app.close_loop import next_toml
from models.checks.excitation import cannot_show, shown_with
from models.effects import CATALOGUE
from models.identification.experiment import Candidate, Question, propose, question, words_of
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.series.series import SeriesKind
from models.identification.motion_plan import Move, Plan, Room
from models.identification.search.search import Search
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.rigs.tables import Noise
from tests.rig_texts import GUT

RIG = parse_rig({"rig": {"kind": "pull"}, "noise": {"force_std_N": 1e-3}, **tomllib.loads(GUT)})


def one_way(seed: int) -> Record:
    """A pull through 16 mm at one speed, without a rest."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 8, 5e-3)
    force = 0.08 * (1 - np.exp(-t / 0.3)) + 1e-3 * rng.standard_normal(len(t))
    return Record(f"r{seed}", "pull", {"t_s": t, "position_m": 2e-3 * t, "force_N": force})


def test_the_next_record_shows_what_the_records_cannot_within_their_places() -> None:
    records = [one_way(1), one_way(2)]
    hidden = cannot_show(RIG, records, CATALOGUE.acting_on("pull"))
    assert {"directional_asymmetry", "stribeck", "dwell_adhesion"} <= hidden.keys()
    unseen = [CATALOGUE[name] for name in hidden]
    kind = kind_for(RIG, records)
    fit = Fitter.of(kind, records, []).far([kind.nominal()])
    found = Search(fit, fit)
    proposal = propose(kind, records, found, shown_with(RIG, records, unseen), np.random.default_rng(0))
    assert proposal is not None
    assert {"directional_asymmetry", "stribeck", "dwell_adhesion"} <= set(proposal.shows) <= hidden.keys()
    motion = Record("next", "pull", {**proposal.motion, "force_N": np.sin(proposal.motion["t_s"])})
    assert not set(proposal.shows) & cannot_show(RIG, [*records, motion], CATALOGUE.acting_on("pull")).keys()
    places = proposal.motion["position_m"]
    assert 0 <= places.min() <= places.max() <= 0.016
    assert np.abs(np.diff(places)).max() / 5e-3 <= 10e-3 * 1.01
    assert "show" in str(words_of(proposal))
    written = tomllib.loads(next_toml(proposal, "pull"))
    assert written["shows"]["effects"] == list(proposal.shows)
    assert "separates" not in written
    nothing = propose(kind, records, found, lambda _: (frozenset(), 0.0), np.random.default_rng(0))
    assert nothing is None


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
    rival = replace(DRYING, theta=Fitter.of(KIND, [one_pass()], DRYING.effects).far([DRYING.theta]).theta)
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
