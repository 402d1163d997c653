"""What is said to show at least is what a search finds: with more of it an effect is named, with less nothing is."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from models.identification.answer import without_size
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.search import search
from models.identification.smallest import smallest, unshown
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
