"""Progress off a terminal: a line for each new stage, one every ten seconds within a stage, and how long is to go."""

import io

from rich.console import Console

from hil.app.console import stage_lines


def lines(even: bool, told: list[tuple[float, str, float]], done: float = 0.0) -> list[str]:
    """What is printed where `told` (time in s, stage, share) is reported."""
    out, now = io.StringIO(), [0.0]
    report = stage_lines(Console(file=out, width=110), "x", even=even, done=done, clock=lambda: now[0])
    for at, stage, share in told:
        now[0] = at
        report(stage, share)
    return out.getvalue().splitlines()


def test_a_stage_is_said_once_and_again_after_a_while_with_what_it_is_at() -> None:
    told = [(0.0, "calibrating", 0.02), (3.0, "fitting: a", 0.3), (5.0, "fitting: b", 0.35), (14.0, "fitting: c", 0.4)]
    assert lines(False, told) == [
        "x:   2 %  calibrating",
        "x:  30 %  fitting: a",
        "x:  40 %  fitting: c, 14 s so far",
    ]


def test_even_work_tells_how_long_it_has_to_go() -> None:
    told = [(0.0, "mpc", 0.0), (4.0, "mpc", 0.1), (20.0, "mpc", 0.25), (21.0, "pid", 0.25)]
    assert lines(True, told) == [
        "x:   0 %  mpc",
        "x:  25 %  mpc, 20 s so far, about 60 s to go",
        "x:  25 %  pid, 21 s so far, about 63 s to go",
    ]


def test_work_that_is_resumed_tells_what_is_left_at_the_pace_of_this_start() -> None:
    told = [(0.0, "runs", 0.996), (20.0, "runs", 0.997), (60.0, "runs", 0.9985)]
    assert lines(True, told, done=0.996) == [
        "x:  99 %  runs",
        "x:  99 %  runs, 20 s so far, about 60 s to go",
        "x:  99 %  runs, 60 s so far, about 36 s to go",
    ]


def test_progress_never_runs_backwards() -> None:
    told = [(0.0, "fitting", 0.42), (1.0, "looking", 0.35), (2.0, "fitting again", 0.4), (3.0, "judging", 0.95)]
    assert [line.split()[1] for line in lines(False, told)] == ["42", "42", "42", "95"]
