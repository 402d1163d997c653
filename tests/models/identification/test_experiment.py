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
from plant import layout as at
from plant.experiments.examples import BELIEVED
from plant.rig import Plant
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


@pytest.mark.parametrize("drive", ["magnetic", "coil", "vibro"])
def test_what_is_unexplained_is_given_20_s_of_a_richer_drive_within_the_places(drive: str) -> None:
    """A carriage is led along new moves; coil and inner mass get pieces of their own command, which the plant follows
    within an eighth of the records' places and one more for the model's error.
    """
    believed, rng = BELIEVED[drive], np.random.default_rng(4)
    rig, truth = parse_rig(believed.tables()), believed.truth(rng)
    records = [Record(f"r{k}", drive, believed.record(truth, rng, 6.0, rate_Hz=200.0)) for k in range(2)]
    kind = kind_for(rig, records)
    fit = Fitter.of(kind, records, []).far([kind.nominal()])
    shown = shown_with(rig, records, [])
    assert propose(kind, records, Search(fit, fit), None, np.random.default_rng(0)) is None
    proposal = propose(kind, records, Search(fit, fit), shown, np.random.default_rng(0), unexplained=True)
    assert proposal is not None
    assert proposal.times_s[-1] == pytest.approx(20.0, abs=0.05)
    driven = proposal.motion[proposal.column]
    most = max(float(np.abs(record[proposal.column]).max()) for record in records)
    assert np.abs(driven).max() <= most + 1e-12
    places = np.concatenate([record["position_m"] for record in records])
    assert places.min() - np.ptp(places) / 8 <= proposal.places_m.min() + 1e-9
    assert proposal.places_m.max() <= places.max() + np.ptp(places) / 8 + 1e-9
    made = np.interp(np.arange(0, 20, truth.step_s), proposal.motion["t_s"], driven)
    if drive == "magnetic":
        seen = Plant(truth).advance(made, 50)[:, at.O_X]
        assert places.min() - np.ptp(places) / 4 <= seen.min() <= seen.max() <= places.max() + np.ptp(places) / 4
    assert "may tell what is left" in str(words_of(proposal))


ROOM = Room("pull", "position_m", 0.0, 20e-3, 0.0, 8e-3, 10.0, 2e-3)
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
    again = Plan(ROOM, (Move(9.7e-3, 1e-3, 0.0),)).motion
    back = Plan(ROOM, (Move(10e-3, 4e-3, 1.0), Move(0.0, 4e-3, 0.0))).motion
    assert asked.separation(back) > 3 * asked.separation(again)
    assert asked.separation(back) > 10
    assert asked.apart["pass"] < asked.separation(back) / 3


def test_a_true_fit_promises_no_more(asked: Question) -> None:
    back = Plan(ROOM, (Move(10e-3, 4e-3, 1.0), Move(0.0, 4e-3, 0.0))).motion
    assert 3 < asked.refitted([one_pass()], back) <= asked.separation(back)
