"""The learner's process killed, stopped or cut off: an answer that says so, another process, an end within a bound."""

import errno
import os
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

from hil.app.learn import background as module
from hil.app.learn.background import CLOSED_S, Background
from hil.app.learn.identify import LearningAnswer, LearningQuestion
from models.theta import Theta
from tests.controller.loops import believed
from tests.hil.app.run.forked import SERVER

QUESTION = LearningQuestion(believed("magnetic"), {}, 0, Theta())
UNUSABLE = "nothing could be identified: "
"""What a living learner says to it."""
LONGEST_S = 60.0


@pytest.fixture(params=["forked"])
def learner(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Background]:
    """Forked from a server that has loaded the program, or "new": started as in a run."""
    if request.param == "forked":
        monkeypatch.setattr(module, "_SPAWN", SERVER)
    with Background() as found:
        found.begin()
        yield found


def process_of(learner: Background) -> Any:
    assert learner._process is not None
    return learner._process


def hit(learner: Background, number: signal.Signals) -> None:
    process = process_of(learner)
    os.kill(process.pid, number)
    if number == signal.SIGKILL:
        process.join(LONGEST_S)


def asked(learner: Background) -> LearningAnswer:
    return learner(QUESTION).result(LONGEST_S)


@pytest.mark.parametrize("learner", ["new"], indirect=True)
def test_killed_before_the_first_question_and_between_two(learner: Background) -> None:
    """Another one is begun, and answers."""
    hit(learner, signal.SIGKILL)
    assert asked(learner).sentence.startswith(UNUSABLE)
    hit(learner, signal.SIGKILL)
    assert asked(learner).sentence.startswith(UNUSABLE)


def test_killed_while_it_answers(learner: Background) -> None:
    """The lesson has failed and says why; the next question is answered."""
    hit(learner, signal.SIGSTOP)
    future = learner(QUESTION)
    time.sleep(0.3)
    assert not future.done()
    os.kill(process_of(learner).pid, signal.SIGKILL)  # the learner's thread alone waits for it
    found = future.result(LONGEST_S)
    assert (found.passed, found.searched) == (False, False)
    assert found.sentence == "the learner's process was killed (SIGKILL)"
    assert asked(learner).sentence.startswith(UNUSABLE)


def test_a_pipe_that_is_broken(learner: Background) -> None:
    pid = process_of(learner).pid
    assert learner._pipe is not None
    learner._pipe.close()
    assert asked(learner).sentence.startswith("the learner's process gave no answer: ")
    assert asked(learner).sentence.startswith(UNUSABLE)
    assert process_of(learner).pid != pid


def test_one_that_cannot_be_started_again(learner: Background, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each question says so; once it can be, it is."""

    def refuse(**_: Any) -> None:
        raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))

    hit(learner, signal.SIGKILL)
    with monkeypatch.context() as patch:
        patch.setattr(module._SPAWN, "Process", refuse)
        for _ in range(2):
            words = asked(learner).sentence
            assert words.startswith("the learner's process cannot be started: ")
            assert os.strerror(errno.EAGAIN) in words
    assert asked(learner).sentence.startswith(UNUSABLE)


@pytest.mark.parametrize("asks", [False, True])
def test_a_stopped_one_ends_with_the_run(asks: bool) -> None:
    """Within the bound, whether it was asked or not; also where the question is longer than the pipe."""
    learner = Background()  # not forked from a server, which tells how a process ended once, to one of two that wait
    learner.begin()
    process = process_of(learner)
    hit(learner, signal.SIGSTOP)
    long = LearningQuestion(QUESTION.rig, {"t": [0.0] * 500_000}, 0, Theta())  # type: ignore[dict-item]
    future = learner(long) if asks else None
    time.sleep(0.2)
    began = time.monotonic()
    learner.__exit__()
    assert time.monotonic() - began < CLOSED_S
    assert process.exitcode == -signal.SIGKILL
    if future is not None:
        assert not future.result(LONGEST_S).passed
    end = time.monotonic() + LONGEST_S
    while any(thread.name.startswith("learner") for thread in threading.enumerate()):
        assert time.monotonic() < end, "nothing that the program would wait for"
        time.sleep(0.01)
