"""What is said to show at least is what a search finds: with more of it an effect is named, with less nothing is."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from models.identification.answer import without_size
from models.identification.fitting.fit import Fit
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.candidates import Trial
from models.identification.search.fitted_model import FittedModel
from models.identification.search.search import Search, search
from models.identification.smallest import not_missed, smallest, unshown
from models.records.record import Record
from models.rigs.reader import parse_rig
from tests.rig_texts import GUT

NOISE = 3e-3
RIG = parse_rig({"rig": {"kind": "pull"}, "noise": {"force_std_N": NOISE}, **tomllib.loads(GUT)})


def pulls(kind_of: tuple[str, ...]) -> tuple[SeriesKind, list[Record]]:
    """Two pulls of 12 s to and fro, of a rig that may have these effects."""
    t, rng = np.arange(0, 12, 5e-3), np.random.default_rng(1)
    ways, noise = {"slow": 3e-3, "fast": 5e-3}, NOISE * rng.standard_normal(len(t))
    moves = {name: way * (1 - np.cos(2 * np.pi * t / 6)) for name, way in ways.items()}
    blank = [Record(name, "pull", {"t_s": t, "position_m": x, "force_N": noise}) for name, x in moves.items()]
    kind = SeriesKind.from_rig(RIG, blank)
    return replace(kind, effects=tuple(e for e in kind.effects if e.id in kind_of)), blank


@pytest.mark.parametrize(("times", "named"), [(0.6, False), (1.7, True)], ids=["less", "more"])
@pytest.mark.parametrize("effect", ["viscous_drag", "directional_asymmetry", "fold_periodic"])
def test_a_search_names_more_of_an_effect_and_not_less(effect: str, times: float, named: bool) -> None:
    kind, blank = pulls((effect,))
    size, p = smallest(kind, blank)[effect].value, kind.effects[0].amplitude()
    own = {**kind.effects[0].start(), p.name: times * size}
    rng = np.random.default_rng(5)
    made = [kind.imitate(record, kind.nominal().with_(effect, own), rng) for record in blank]
    assert search(kind, made, lambda *_: None, np.random.default_rng(0)).effects == ([effect] if named else [])


def test_what_no_size_shows_has_none_and_a_reason() -> None:
    """Mains hum at 50 Hz in samples of 5 ms, and a break-away after rests that these pulls lack."""
    kind, blank = pulls(("dwell_adhesion", "fold_periodic"))
    sizes = smallest(kind, blank)
    assert sizes.keys() == {"fold_periodic"}
    assert without_size(kind, sizes).keys() == {"dwell_adhesion"}
    values = {"fold_periodic": 0.01, "dwell_adhesion": 1.0}
    assert [effect.id for effect in unshown(kind, values)] == ["dwell_adhesion"]


def test_what_a_search_has_missed_counts_as_not_shown() -> None:
    """Of the candidates' fits one gained too little, one enough (a rival of what was named), one nothing."""
    kind, blank = pulls(("viscous_drag", "directional_asymmetry", "fold_periodic"))
    fit = Fit(kind.nominal(), 1.0, 1, np.zeros((1, 0)), np.zeros(1))
    fitted = {"viscous_drag": (0.02, 0.3), "directional_asymmetry": (0.2, 0.9), "fold_periodic": (0.3, -0.1)}
    trials = []
    for effect in kind.effects:
        size, gain = fitted[effect.id]
        theta = kind.nominal().with_(effect.id, {**effect.start(), effect.amplitude().name: size})
        model = FittedModel(kind, kind.splits(blank), (effect.id,), (theta,) * len(kind.splits(blank)))
        trials.append(Trial(effect.id, model, np.exp(gain) * model.blocks))
    found = Search(fit, fit, rounds=[(1, [], trials)], threshold=0.4)
    sizes = dict.fromkeys(fitted, 0.001)
    assert not_missed(kind, sizes, found) == {**sizes, "viscous_drag": 0.02}
    assert not_missed(kind, {"fold_periodic": 0.001}, found) == {"fold_periodic": 0.001}
