"""A log played on the local bus at its own pace: what a page shows does not hang on how busy the machine is."""

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import can

from hil.bus.local import LocalBus
from hil.log.blf_file import NOTED, Logged
from hil.log.reader import read_frames


def frames_of(path: Path) -> list[Logged]:
    """The frames of a log, without its notes."""
    return [frame for frame in read_frames(path) if frame.direction != NOTED]


@contextmanager
def played(frames: Sequence[Logged], channel: str) -> Iterator[threading.Event]:
    """Play `frames` on `channel` for the time of the block, or until the event is set."""
    ended = threading.Event()

    def play() -> None:
        with LocalBus(channel) as bus:
            began, first = time.monotonic(), frames[0].time_s
            for frame in frames:
                left = frame.time_s - first - (time.monotonic() - began)
                if left > 0.01 and ended.wait(left):
                    return
                if ended.is_set():
                    return
                bus.send(can.Message(arbitration_id=frame.id, is_extended_id=False, data=frame.data))

    player = threading.Thread(target=play)
    player.start()
    try:
        yield ended
    finally:
        ended.set()
        player.join()
