"""Listening to a bus whose driver may raise: for a while, or to what waits there."""

import time
from collections.abc import Callable, Collection, Iterator

import can


def heard_for(bus: can.BusABC, seconds: float) -> Iterator[can.Message]:
    """The frames that come within `seconds`; whatever a driver raises is a moment in which nothing is heard."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        try:
            message = bus.recv(left)
        except Exception:  # noqa: BLE001 - drivers of many makers raise whatever they like
            time.sleep(0.001)
            continue
        if message is not None:
            yield message


def waiting(
    bus: can.BusABC, most: int, deaf: Callable[[Exception], object] = lambda error: None
) -> Iterator[can.Message]:
    """The frames that wait, at most `most`; on a bus that raises nothing does, and `deaf` hears what it says."""
    for _ in range(most):
        try:
            message = bus.recv(0)
        except Exception as error:  # noqa: BLE001 - drivers of many makers raise whatever they like
            deaf(error)
            return
        if message is None:
            return
        yield message


def silent(node: str, seconds: float, others: Collection[int], errors: int, causes: tuple[str, str]) -> ValueError:
    """That `node` did not answer within `seconds`, who speaks instead, and what to look at: the first of `causes` where
    there were error frames, the second where there was silence.
    """
    speak = f"; node {', '.join(map(str, sorted(others)))} speaks" if others else ""
    broken = f"; {errors} error frames: {causes[0]}" if errors else ""
    silence = "" if speak or broken else f"; silence: {causes[1]}"
    return ValueError(f"{node} must answer within {seconds:g} s{speak}{broken}{silence}")
