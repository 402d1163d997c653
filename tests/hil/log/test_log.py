"""Logs: what was sent is read back to the nanosecond, and what a kill leaves is whole up to the last second."""

import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hil.log.recorder as recorder
from hil.formats.reading import is_log
from hil.log.blf_file import LOST, NOTED, RECEIVED, SENT, WITHHELD, BlfFile, Logged, unpacked
from hil.log.log import FrameLog, LockstepLog
from hil.log.place import keep_older, record_path, write_record
from hil.log.reader import read_frames, read_log_record
from hil.own_process import version_of

NODE = """
import sys, time
from pathlib import Path
from hil.log.blf_file import SENT, Logged
from hil.log.log import FrameLog
log = FrameLog(Path(sys.argv[1]), {"rig": "test"})
began, k = time.monotonic(), 0
while True:
    log.put([Logged(k * 1_000_000, 0x100, k.to_bytes(8, "little"), SENT)])
    k += 1
    if k % 50 == 0:
        print(k, log._writer.pid, flush=True)
        time.sleep(0.02)
"""
FRAMES = st.builds(
    Logged,
    st.integers(0, 10**14),
    st.integers(0, 0x7FF),
    st.binary(max_size=8),
    st.sampled_from((RECEIVED, SENT, WITHHELD, NOTED)),
)


def sent(log: FrameLog, time_s: float, identifier: int, data: bytes) -> None:
    """A frame that a tick sent."""
    log.put([Logged(round(time_s * 1e9), identifier, data, SENT)])


@given(st.lists(FRAMES, max_size=30))
def test_frames_are_read_back_as_written(tmp_path_factory: pytest.TempPathFactory, frames: list[Logged]) -> None:
    path = tmp_path_factory.mktemp("log") / "a.blf"
    file = BlfFile(path)
    for frame in frames:
        file.write(frame)
    file.stop()
    assert list(read_frames(path)) == frames


@given(st.lists(FRAMES, max_size=5))
def test_frames_pass_the_pipe_unchanged(frames: list[Logged]) -> None:
    assert unpacked(b"".join(frame.packed() for frame in frames)) == frames


@pytest.mark.parametrize("kind", [FrameLog, LockstepLog])
def test_a_log_keeps_order_way_and_record(tmp_path: Path, kind: type[FrameLog] | type[LockstepLog]) -> None:
    path = tmp_path / "run.blf"
    expected = [
        Logged(250_000_000, 0x200, b"12345678", RECEIVED),
        Logged(2_000_000, 0x100, b"abc", SENT),
        Logged(2_000_000, 0x110, b"", WITHHELD),
    ]
    with kind(path, {"rig": "r", "code": "c"}) as log:
        log.put(expected)
    assert (log.written, log.dropped) == (3, 0)
    assert list(read_frames(path)) == expected
    found = read_log_record(path)
    found.pop("calendar_start_s", None)
    assert found == {"format": 2, "rig": "r", "code": "c", "entries": 3}


def _node(path: Path) -> tuple[subprocess.Popen[str], int, int, float]:
    """A process that logs, once it has logged for a while; its writer's process, how many frames it has logged and how
    many a second.
    """
    node = subprocess.Popen([sys.executable, "-c", NODE, str(path)], stdout=subprocess.PIPE, text=True)
    assert node.stdout is not None
    words = node.stdout.readline().split()  # the log has begun
    began = time.monotonic()
    while time.monotonic() - began < 2.5:
        words = node.stdout.readline().split()
    return node, int(words[1]), int(words[0]), int(words[0]) / (time.monotonic() - began)


def test_a_killed_node_loses_nothing_that_it_logged(tmp_path: Path) -> None:
    path = tmp_path / "killed.blf"
    node, _, said, _ = _node(path)
    node.send_signal(signal.SIGKILL)
    node.communicate()
    size = -1
    while path.stat().st_size != size:
        size = path.stat().st_size
        time.sleep(1.0)
    numbers = [int.from_bytes(frame.data, "little") for frame in read_frames(path)]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) >= said > 1000


def test_a_killed_writer_leaves_all_but_the_last_second(tmp_path: Path) -> None:
    path = tmp_path / "killed.blf"
    node, writer, said, rate = _node(path)
    os.kill(writer, signal.SIGKILL)
    node.kill()
    node.communicate()
    numbers = [int.from_bytes(frame.data, "little") for frame in read_frames(path)]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) >= said - rate > 500


def thousand(path: Path) -> Path:
    """A log of a thousand numbered frames, flushed after every hundred."""
    file = BlfFile(path)
    for k in range(1000):
        file.write(Logged(k, k % 0x7FF, k.to_bytes(8, "little"), SENT))
        if k % 100 == 99:
            file.flush()
    file.stop()
    return path


@pytest.mark.parametrize("share", [0.3, 0.6, 0.99])
def test_a_file_that_ends_in_the_middle_gives_what_is_whole(tmp_path: Path, share: float) -> None:
    path = thousand(tmp_path / "a.blf")
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    numbers = [int.from_bytes(frame.data, "little") for frame in read_frames(path)]
    assert numbers == list(range(len(numbers)))
    assert len(numbers) >= 1000 * share - 200


def test_a_damaged_file_is_one_sentence(tmp_path: Path) -> None:
    path = thousand(tmp_path / "a.blf")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"a\.blf: log must be undamaged; got after \d+ frames"):
        list(read_frames(path))


def test_a_dead_writer_does_not_disturb_the_node(tmp_path: Path) -> None:
    """Another one goes on; what the dead one had not flushed is told of, at once and at the end."""
    told: list[str] = []
    log = FrameLog(tmp_path / "a.blf", {}, told.append)
    first = log._writer
    for k in range(100):
        sent(log, 1e-3 * k, 1, b"")
    began = time.monotonic()
    while log._on_file < 100 and time.monotonic() - began < 60:
        time.sleep(0.02)
    first.kill()
    first.wait()
    for k in range(100, 200):
        sent(log, 1e-3 * k, 1, b"")
    while log._writer is first and time.monotonic() - began < 60:
        time.sleep(0.02)
    assert "its writer ended (by signal 9); frames are missing; another one goes on" in told[0]
    log.close()
    assert (log.dropped, log.lost) == (0, 0)
    found = list(read_frames(tmp_path / "a.blf"))
    assert [f.time_ns for f in found if f.direction == SENT] == [k * 1_000_000 for k in range(200)]
    assert [f.id for f in found if f.direction == NOTED] == [LOST]


def test_a_disk_that_is_full_is_told_at_once_and_what_waits_is_written_later(tmp_path: Path) -> None:
    """Here the system lets the writer's files grow no further; the next writer has room again."""
    told: list[str] = []
    with FrameLog(tmp_path / "a.blf", {}, told.append) as log:
        sent(log, 0.0, 1, b"")
        began = time.monotonic()
        while log._on_file < 1 and time.monotonic() - began < 60:
            time.sleep(0.02)
        size = (tmp_path / "a.blf").stat().st_size
        resource.prlimit(log._writer.pid, resource.RLIMIT_FSIZE, (size, size))
        for k in range(1, 300):
            sent(log, 1e-3 * k, 1, k.to_bytes(8, "little"))
        while not told and time.monotonic() - began < 60:
            time.sleep(0.02)
        assert told, "while the node goes on"
        sent(log, 1.0, 1, b"")
    assert "frames are missing" in told[0]
    assert log.lost > 0
    assert log.troubles[-1].endswith("frames that were handed to its writer are not on file")
    found = list(read_frames(tmp_path / "a.blf"))
    assert [f.time_ns for f in found if f.direction == SENT][-1] == 1_000_000_000
    assert LOST in [f.id for f in found if f.direction == NOTED]


def test_two_logs_of_one_name_are_two_files(tmp_path: Path) -> None:
    path = tmp_path / "run.blf"
    with FrameLog(path, {"run": 1}) as first, FrameLog(path, {"run": 2}) as second:
        sent(first, 0.1, 1, b"1")
        sent(second, 0.2, 2, b"2")
    assert (first.path, second.path, first.kept, second.kept) == (path, tmp_path / "run-run2.blf", None, None)
    assert [f.id for f in read_frames(first.path)] == [1]
    assert [f.id for f in read_frames(second.path)] == [2]
    assert [read_log_record(log.path)["run"] for log in (first, second)] == [1, 2]
    with FrameLog(path, {"run": 3}) as third:
        sent(third, 0.3, 3, b"3")
    assert (third.path, third.kept) == (path, tmp_path / "run-1.blf")
    assert [f.id for f in read_frames(tmp_path / "run-1.blf")] == [1]


def test_other_programs_read_the_time_of_day(tmp_path: Path) -> None:
    path = tmp_path / "run.blf"
    with FrameLog(path, {}) as log:
        sent(log, 12.5, 1, b"1")
    with can.LogReader(path) as reader:
        (message,) = list(reader)
    assert message.timestamp == pytest.approx(read_log_record(path)["calendar_start_s"] + 12.5, abs=0.01)
    assert abs(message.timestamp - 12.5 - time.time()) < 600


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.blf", b"", "log must hold frames"),
        ("b.blf", b"not a log at all" * 20, "log must be one in the format"),
        ("c.mf4", b"x" * 100, "must hold frames of a CAN bus"),
        ("d.blf", None, "log must be a file that can be read"),
    ],
)
def test_what_is_no_log_is_one_sentence(tmp_path: Path, name: str, content: bytes | None, sentence: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        list(read_frames(path))


def test_names_of_logs_and_their_records(tmp_path: Path) -> None:
    assert is_log(Path("a.BLF"))
    assert is_log(Path("a.asc"))
    assert not is_log(Path("a.csv"))
    assert record_path(Path("x/run.blf")) == Path("x/run.json")
    with pytest.raises(ValueError, match=r"ends in \.blf"):
        write_record(tmp_path / "run.csv", {})
    with pytest.raises(ValueError, match="can be written"):
        FrameLog(tmp_path / "no folder" / "run.blf", {})
    with pytest.raises(ValueError, match="record of the log must be there"):
        read_log_record(tmp_path / "run.blf")
    (tmp_path / "run.json").write_text("[]")
    with pytest.raises(ValueError, match="JSON object"):
        read_log_record(tmp_path / "run.blf")


def test_an_older_log_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "run.blf"
    assert keep_older(path) is None
    for number in (1, 2):
        path.write_bytes(bytes([number]))
        record_path(path).write_text(f"{number}")
        assert keep_older(path) == tmp_path / f"run-{number}.blf"
    assert not path.exists()
    for number in (1, 2):
        kept = tmp_path / f"run-{number}.blf"
        assert (kept.read_bytes(), record_path(kept).read_text()) == (bytes([number]), f"{number}")
    path.touch()
    assert keep_older(path) == tmp_path / "run-3.blf"


def test_a_log_that_is_not_there_at_its_end_is_told(tmp_path: Path) -> None:
    """Its folder was removed, another file stands there, or it was emptied: no frame of it counts as kept."""

    def replaced(path: Path) -> None:
        path.unlink()
        path.write_bytes(b"")

    def emptied(path: Path) -> None:
        os.truncate(path, 0)

    for number, spoil in enumerate((lambda path: shutil.rmtree(path.parent), replaced, emptied)):
        path, told = tmp_path / str(number) / "run.blf", list[str]()
        path.parent.mkdir()
        with FrameLog(path, {}, told.append) as log:
            sent(log, 0.001, 0x100, b"abc")
            time.sleep(1.0)
            spoil(path)
            sent(log, 0.002, 0x100, b"abc")
            time.sleep(1.0)
        assert log.lost == 2
        assert "frames are missing" in log.troubles[-1]
        assert bool(told) == (spoil is not emptied)


@pytest.mark.parametrize("kind", [FrameLog, LockstepLog])
def test_a_log_is_a_regular_file(tmp_path: Path, kind: type[FrameLog] | type[LockstepLog]) -> None:
    """A pipe that nobody reads, a device, a socket and a folder are refused, not waited for."""
    os.mkfifo(tmp_path / "pipe.blf")
    (tmp_path / "device.blf").symlink_to("/dev/null")
    (tmp_path / "folder.blf").mkdir()
    with socket.socket(socket.AF_UNIX) as bound:
        bound.bind(str(tmp_path / "socket.blf"))
    for name, what in (("pipe", "a pipe"), ("device", "a device"), ("socket", "socket"), ("folder", "a folder")):
        with pytest.raises(ValueError, match=rf"log must be a regular file; got .*{what}"):
            kind(tmp_path / f"{name}.blf", {})
    assert not list(tmp_path.glob("*.json"))


def test_a_slow_git_costs_the_commit_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "git").write_text("#!/bin/sh\nexec sleep 5\n")
    (tmp_path / "git").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(recorder, "_GIT_S", 0.1)
    assert recorder.code_version() == version_of()
