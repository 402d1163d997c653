"""From broken to better: gathered, asked, offered, taken at a rest, kept or taken back; nothing without the gate."""

from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from controller.model.control_model import ControlModel
from controller.monitor import Health
from controller.reference import Experiment
from controller.signals import Measurement
from controller.supervision.model_switch import History, Offer, Prepared
from hil.app.learn import identify
from hil.app.learn.identify import LearningAnswer, LearningQuestion, answer
from hil.app.learn.learner import Learner, LearningTable
from models.identification import Model
from models.identification.kinds import kind_for, ready
from models.rigs.columns import TIME
from models.rigs.rig import Rig
from models.theta import Theta
from tests.controller.loops import believed, model_of

PACE = LearningTable(gathered_s=20.0, held_out_share=0.25, answer_s=10.0, trial_s=10.0)
FOUND = LearningAnswer(
    Theta.of({"magnet_stiffness_N_per_m": 24.0}), ("fold_periodic",), "named", "held-out error lower"
)
NOTHING = LearningAnswer(Theta(), (), "none", "held-out error must be lower")
TICK = 0.01


@dataclass
class Switch:
    """A model switch that takes over when it is told to."""

    history: History | None = None
    taken_at: float = float("nan")
    origin_s: float = 0.0
    tick_s: float = TICK
    proposed: list[Offer] = field(default_factory=list)

    def prepare(self, offer: Offer) -> Prepared:
        return Prepared(offer, [], None, None)  # type: ignore[arg-type]

    def put(self, prepared: Prepared) -> None:
        self.proposed.append(prepared.offer)


@dataclass
class Story:
    """A learner, and what it asked."""

    found: LearningAnswer
    learning: LearningTable = PACE
    asked: list[LearningQuestion] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.driven: list[Experiment] = []
        self.switch = Switch()
        rig: Rig = believed("magnetic")
        model: ControlModel = model_of()
        self.learner = Learner(
            self.switch,  # type: ignore[arg-type]
            rig,
            Theta(),
            lambda values: model,
            self.ask,
            self.learning,
            drive=self.driven.append,
        )

    def ask(self, question: LearningQuestion) -> Future[LearningAnswer]:
        self.asked.append(question)
        future: Future[LearningAnswer] = Future()
        future.set_result(self.found)
        return future

    def run(self, begin: float, end: float, health: Health, error_m: float) -> None:
        assert self.switch.history is not None
        for k in range(round((end - begin) / TICK)):
            now = begin + k * TICK
            place = [Measurement("position_m", 1e-3 * now, now), Measurement("carriage_position_m", 2e-3 * now, now)]
            self.switch.history.add(place)
            self.learner.step(now, health, error_m)


BROKEN = Health("broken", 8.0, "sudden", 1, 1.1)


def test_the_whole_way_and_a_better_model_stays() -> None:
    story = Story(FOUND)
    story.run(0.0, 10.0, Health(), 1e-3)
    story.run(10.0, 29.0, BROKEN, 1e-3)
    (question,) = story.asked
    assert question.columns[TIME][0] == pytest.approx(0.0, abs=0.02), "what the model left while it held is asked, too"
    assert question.columns[TIME][question.broken_from] == pytest.approx(8.0, abs=0.02)
    assert question.columns[TIME][question.held_from] == pytest.approx(23.0, abs=0.02)
    assert np.allclose(question.columns["carriage_position_m"], 2 * question.columns["position_m"])
    assert not story.switch.proposed, "simulated time waits for the answer no shorter than it was to take"
    story.run(29.0, 40.0, BROKEN, 1e-3)
    assert [round(one.at_s, 1) for one in story.switch.proposed] == [38.0]
    story.switch.taken_at = 40.0
    story.run(40.0, 60.0, Health("holds", 40.0, "", 1), 0.5e-3)
    (lesson,) = story.learner.lessons
    assert (lesson.effects, lesson.taken_at_s, lesson.withdrawn_at_s) == (("fold_periodic",), 40.0, None)
    assert [one.at_s for one in story.learner.offers] == [pytest.approx(38.0, abs=TICK)]
    assert lesson.document()["broken_at_s"] == 8.0
    assert "taken at 40.0 s" in lesson.words


def test_a_model_that_turns_out_worse_is_taken_back() -> None:
    story = Story(FOUND)
    story.run(8.0, 40.0, BROKEN, 1e-3)
    story.switch.taken_at = 40.0
    story.run(40.0, 60.0, Health("holds", 40.0, "", 1), 2e-3)
    (lesson,) = story.learner.lessons
    assert lesson.withdrawn_at_s == pytest.approx(50.0, abs=0.1)
    assert [one.values for one in story.learner.offers] == [FOUND.values, Theta()]
    assert len(story.switch.proposed) == 2


def test_what_does_not_pass_the_gate_is_not_offered_and_asked_again_with_more() -> None:
    story = Story(NOTHING)
    story.run(8.0, 90.0, BROKEN, 1e-3)
    assert not story.switch.proposed
    assert len(story.asked) >= 2
    assert story.asked[1].columns[TIME].size > story.asked[0].columns[TIME].size
    assert [one.base_holds for one in story.asked[:2]] == [True, False]
    assert story.learner.lessons[0].words.endswith("not offered: held-out error must be lower")


def test_an_experiment_is_driven_only_where_it_is_allowed() -> None:
    forbidden, allowed = Story(NOTHING), Story(NOTHING, PACE.but(experiment_mm=3.0, experiment_s=12.0))
    for story in (forbidden, allowed):
        story.run(8.0, 75.0, BROKEN, 1e-3)
    assert not forbidden.driven
    assert forbidden.learner.record["experiments"] == []
    first = allowed.driven[0]
    assert first.at_s == pytest.approx(38.0, abs=0.1)
    assert 1e-3 < np.max(np.abs(first.path.positions)) <= 3e-3
    assert first.path.end_s < 20.0
    assert allowed.asked[1].columns[TIME][-1] == pytest.approx(38.0 + 20.0 + first.path.end_s, abs=0.1)
    assert "experiment from 38.0 s on" in allowed.learner.lessons[0].words


def test_nothing_is_asked_while_the_model_holds() -> None:
    story = Story(FOUND)
    story.run(0.0, 60.0, Health(), 1e-3)
    story.run(60.0, 90.0, Health("doubtful", 60.0, "", 0, 0.7), 1e-3)
    assert (story.asked, story.learner.lessons) == ([], [])


def test_records_that_cannot_be_used_are_an_answer() -> None:
    found = answer(LearningQuestion(believed("magnetic"), {TIME: np.arange(3.0)}, 2, Theta()))
    assert not found.passed
    assert found.sentence.startswith("nothing could be identified: ")


@pytest.mark.parametrize(("verdict", "share", "offered"), [("named", 0.9, True), ("unknown", 0.9, False)])
def test_a_model_that_explains_a_part_must_gain_more(
    monkeypatch: pytest.MonkeyPatch, verdict: str, share: float, offered: bool
) -> None:
    rig = believed("magnetic")
    kind = kind_for(rig, [])
    t = np.arange(0.0, 4.0, 0.01)
    columns = {TIME: t, "carriage_position_m": 1e-3 * t, "position_m": 1e-3 * t}
    nominal = kind.nominal()
    seen: dict[str, object] = {}

    def found(*given: object, known: dict[str, tuple[float, float]], most: int, drawn: bool) -> tuple[object, Model]:
        assert not drawn
        seen.update(known, most=most)
        held = [ready(record, rig) for record in given[2]]  # type: ignore[attr-defined]
        error = kind.error(held, [kind.predict(record, nominal) for record in held])
        stages = {"nominal": nominal, "calibrated": nominal, "augmented": nominal}
        finding = SimpleNamespace(
            effects=[SimpleNamespace(id="lumen_taper")],
            error={"holdout": {"augmented": share * error}},
            verdict=verdict,
            next_experiment="faster",
            proposal=None,
            seconds=1.0,
            unit="m",
        )
        return finding, Model("magnetic", stages, verdict)

    monkeypatch.setattr(identify, "close", found)
    in_use = Theta.of({"friction_coefficient": 0.09, ("actuator_lag", "time_s"): 0.1})
    answered = answer(LearningQuestion(rig, columns, 300, in_use))
    assert answered.passed == offered
    assert seen["friction_coefficient"] == (0.09, pytest.approx(9e-4))
    assert seen["actuator_lag", "time_s"] == (0.1, pytest.approx(1e-3))
    assert seen["most"] == 1
    wanted = "not compared in control before" if offered else "at most 0.5 of the current model's"
    assert wanted in answered.sentence


def test_a_rig_that_makes_no_record_is_refused() -> None:
    with pytest.raises(ValueError, match="--learn must stand with a rig of kind magnetic or coil; got vibro"):
        Learner(Switch(), replace(believed(), kind="vibro"), Theta(), lambda values: model_of(), Story(FOUND).ask)  # type: ignore[arg-type]


def test_a_history_keeps_the_newest_in_order() -> None:
    history = History(["position_m"], room=4)
    history.add([Measurement("position_m", float(k), t) for k, t in enumerate([0.0, 1.0, 3.0, 2.0, 4.0, 5.0])])
    history.add([Measurement("coil_current_A", 1.0, 6.0)])
    times, values = history.since("position_m", 0.0)
    assert times.tolist() == [3.0, 4.0, 5.0]
    assert values.tolist() == [2.0, 4.0, 5.0]
    assert history.since("position_m", 4.5)[0].tolist() == [5.0]


def test_a_history_gives_the_same_from_a_ring_that_went_round_however_far_back_is_asked() -> None:
    history = History(["position_m"], room=1000)
    for k in range(2600):
        history.add([Measurement("position_m", float(k), 0.01 * k)])
        if k in {200, 999, 1000, 2599}:
            for begin in (0, k - 900, k - 300, k - 10, k):
                first = max(begin, k - 999, 0)
                assert history.since("position_m", 0.01 * begin - 1e-9)[1].tolist() == list(range(first, k + 1))
