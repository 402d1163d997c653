"""The page of a run that learned: its numbers are the trace's, and it says what happened when."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hil.app.learn.learner import Lesson
from hil.app.scenario.bus_scenario import SilScenario, load_sil_scenario
from hil.app.scenario.model_use import Offered
from hil.app.sil.learning_page import NUMBERS, PAGE, error_by_second, instants, learning_files
from hil.app.sil.sil import judged
from hil.app.sil.testbed import believed_on_bus
from models.theta import Theta
from plant import layout as at
from tests.hil.app.sil.test_sil import SHORT

TOLD = Lesson(0.1, ("fold_periodic",), "named", "held-out error lower", 0.3, 0.4, asked_at_s=0.2, answers=1)


def learned_pages(folder: Path) -> tuple[SilScenario, dict[str, str]]:
    """A scenario, and page and numbers of a short run of it in which something was learned."""
    path = folder / "short.toml"
    path.write_text(SHORT)
    scenario, _ = load_sil_scenario(path)
    hidden = {"fold_periodic": {"excess": 0.2, "onset_s": 0.05}}
    scenario = replace(scenario, loop=replace(scenario.loop, truth=replace(scenario.loop.truth, hidden=hidden)))
    found, trace = judged(scenario, believed_on_bus(scenario, Theta()), None, 1, "nominal")
    trace.lessons, trace.offers = (
        [TOLD],
        [Offered(Theta.of({"friction_coefficient": 0.09, ("fold_periodic", "depth"): 0.2}), 0.3)],
    )
    found["learned"] = [TOLD.document()]
    seconds, errors = error_by_second(scenario, trace)
    x, t = trace.rows[:, at.O_X], trace.rows[:, at.O_T]
    wanted = np.sqrt(np.mean((x - scenario.loop.reference.position(t)) ** 2))
    assert seconds.tolist() == [0.0]
    assert errors == pytest.approx([wanted])
    return scenario, {file.name: text for file, text in learning_files(Path(), scenario, found, trace).items()}


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> tuple[SilScenario, dict[str, str]]:
    return learned_pages(tmp_path_factory.mktemp("story"))


def test_the_instants_stand_in_order_of_time(story: tuple[SilScenario, dict[str, str]]) -> None:
    trace = SimpleNamespace(lessons=[TOLD], experiments_at=[0.25])
    marks = [what for _, what in instants(story[0], trace)]  # type: ignore[arg-type]
    first = ["onset of folds of the gut", "model broken since", "identification begins"]
    assert marks == [*first, "experiment begins", "offered", "taken"]


def test_the_page_says_what_was_learned_and_the_numbers_stand_beside_it(
    story: tuple[SilScenario, dict[str, str]],
) -> None:
    page, numbers = story[1][PAGE], json.loads(story[1][NUMBERS])
    assert "folds of the gut learned and taken at" in page
    assert "base + folds of the gut" in page
    assert "Violations of hard limits: 0" in page
    assert [mark["what"] for mark in numbers["instants"]][-1] == "taken"
    assert numbers["parts"][-1]["until"] == "end of the run"
    assert numbers["learned"][0]["answers"] == 1


def test_a_run_that_held_says_so(story: tuple[SilScenario, dict[str, str]]) -> None:
    scenario = story[0]
    found, trace = judged(scenario, believed_on_bus(scenario, Theta()), None, 1, "nominal")
    files = learning_files(Path(), scenario, {**found, "learned": []}, trace)
    assert "the model held, nothing was learned" in files[Path(PAGE)]
