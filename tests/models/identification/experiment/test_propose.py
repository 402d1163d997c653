"""The next record of a rig whose records leave effects out of sight."""

import tomllib

import numpy as np

from hil.app.close_loop import next_toml
from models.checks.excitation import cannot_show, shown_with
from models.effects import CATALOGUE
from models.identification.experiment.propose import propose, words_of
from models.identification.kinds import kind_for
from models.identification.search.forward_selection import Search
from models.identification.search.refit import whole
from models.records.record import Record
from models.rigs.reader import parse_rig
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
    found = Search(*[whole(kind, records, [], kind.nominal(), to_the_end=False)] * 2)
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
