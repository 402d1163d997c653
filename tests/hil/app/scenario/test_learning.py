"""The table `[learning]`: read from a scenario and a deployment alike, refused in one sentence."""

import tomllib

import pytest

from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.scenario.deployment_tables import LearningTable
from tests.hil.app.sil.test_sil import SHORT


def test_a_scenario_says_how_long_is_gathered() -> None:
    raw = tomllib.loads(SHORT)
    assert parse_sil_scenario(raw).learning == LearningTable()
    assert parse_sil_scenario({**raw, "learning": {"gathered_s": 30.0}}).learning == LearningTable(gathered_s=30.0)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"gathered_s": 1.0}, r"learning.gathered_s must lie in \[10, 240\]; got 1"),
        ({"held_out_share": 0.9}, r"learning.held_out_share must lie in \[0.1, 0.5\]; got 0.9"),
        ({"gathered": 30.0}, "did you mean 'gathered_s'"),
        ({"trial_s": "long"}, "learning.trial_s"),
    ],
)
def test_what_it_cannot_be_is_told(table: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        LearningTable.read({"learning": table})
