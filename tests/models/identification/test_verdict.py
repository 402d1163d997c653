"""What a finished search allows to say."""

from __future__ import annotations

import numpy as np
import pytest

from models.identification.fitting.fit import Fit
from models.identification.identify import held_out, verdict_of
from models.identification.search.forward_selection import Search

FIT = Fit({}, 1.0, 1, np.zeros((1, 0)), np.ones(1))


@pytest.mark.parametrize(
    ("after", "chance", "said"),
    [(1.05, 1.0, "none"), (1.7, 1.6, "none"), (2.0, 1.0, "unknown"), (8.0, 6.3, "unknown"), (8.0, 1.0, "unknown")],
)
def test_nothing_is_missing_only_where_chance_and_about_the_noise_explain_what_is_left(
    after: float, chance: float, said: str
) -> None:
    """A model whose own predictions its fits miss by far leaves that much with and without an effect."""
    assert verdict_of(Search(FIT, FIT, after=after, null_cost=chance), 0.9, fits=True) == said


@pytest.mark.parametrize(
    ("after", "share", "said"), [(1.4, 0.9, "named"), (5.0, 0.9, "unknown"), (5.0, 0.6, "named"), (2.5, 0.9, "named")]
)
def test_an_effect_that_leaves_clearly_more_than_the_noise_is_named_by_its_share(
    after: float, share: float, said: str
) -> None:
    """Another effect with a like shape takes most of the misfit away too, but not what is its own."""
    found = Search(FIT, FIT, effects=["stress_relaxation"], before=28.0, after=after)
    assert verdict_of(found, share, fits=share < 0.9) == said


@pytest.mark.parametrize(("fits", "said"), [(True, "named"), (False, "unknown")])
def test_sensitive_motion_excuses_the_residual_only_of_a_model_that_fits(fits: bool, said: str) -> None:
    found = Search(FIT, FIT, effects=["stribeck"], before=57.0, after=12.2, sensitivity=8.5)
    assert verdict_of(found, 0.9, fits) == said


def test_a_report_says_where_held_out_records_speak_against_what_was_named() -> None:
    found = Search(FIT, FIT, effects=["stribeck"])
    assert held_out(found, {"nominal": 1.6, "calibrated": 0.46, "augmented": 0.67})
    assert not held_out(found, {"nominal": 1.6, "calibrated": 0.46, "augmented": 0.1})
    assert not held_out(found, {})
    assert not held_out(Search(FIT, FIT), {"nominal": 1.6, "calibrated": 0.46, "augmented": 0.46})
