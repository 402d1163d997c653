"""An authenticated bus: frames come through as they are; forged, repeated and classic ones do not; keys and epochs."""

import os
import random
import time
from pathlib import Path

import can
import pytest
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.cmac import CMAC

from hil.bus.authenticated import LENGTH, AuthenticatedBus, authenticator, next_epoch, read_key
from hil.bus.local import LocalBus
from tests.bench.bench_forgery import KEY, Wire, forge

GOOD = bytes(range(8))


def message(data: bytes = GOOD, identifier: int = 0x100) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)


def test_the_authenticator_is_that_of_rfc_4493() -> None:
    """Its second example: the whole tag over one block, of which the first eight bytes are sent."""
    key = bytes.fromhex("2b7e151628aed2a6abf7158809cf4f3c")
    block = bytes.fromhex("6bc1bee22e409f96e93d7e117393172a")
    whole = CMAC(AES(key))
    whole.update(block)
    assert whole.finalize() == bytes.fromhex("070a16b46b4d4144f79bdd9dd04a287c")
    identifier, body = int.from_bytes(block[:2], "little"), block[2:]
    assert authenticator(key)(identifier, body) == bytes.fromhex("070a16b46b4d4144")


def test_frames_come_through_as_they_are(channel: str) -> None:
    """Over the local bus, as FD with a switched bit rate; what is not authenticated is not heard."""
    with (
        AuthenticatedBus(LocalBus(channel, fd=True), KEY, 7) as a,
        AuthenticatedBus(LocalBus(channel, fd=True), KEY, 8) as b,
        AuthenticatedBus(LocalBus(channel, fd=True), bytes(16), 9) as other,
        LocalBus(channel, fd=True) as tap,
    ):
        for bus in (a, b, other, tap):
            assert bus.recv(0.01) is None
        for number in range(20):
            a.send(message(bytes([number] * 8)))
            tap.send(message())
            other.send(message())
        found = [b.recv(0.1) for _ in range(20)]
        assert [bytes(m.data) for m in found if m is not None] == [bytes([n] * 8) for n in range(20)]
        assert all(m is not None and not m.is_fd and m.arbitration_id == 0x100 and m.is_rx for m in found)
        assert b.recv(0.01) is None
        assert dict(b.refused) == {"classic": 20, "forged": 20}
        wire = tap.recv(0.1)
        assert wire is not None
        assert (wire.is_fd, wire.bitrate_switch, len(wire.data)) == (True, True, LENGTH)


def test_over_udp_multicast_too() -> None:
    rates = {"fd": True, "bitrate": 1_000_000, "data_bitrate": 5_000_000}
    try:
        inner = [can.Bus(interface="udp_multicast", channel="239.74.163.77", **rates) for _ in range(2)]
    except (OSError, can.CanError, ImportError) as error:
        pytest.skip(f"needs multicast and msgpack: {error}")
    with AuthenticatedBus(inner[0], KEY, 7) as a, AuthenticatedBus(inner[1], KEY, 8) as b:
        for number in range(3):
            a.send(message(bytes([number] * 8)))
        found = [b.recv(1.0) for _ in range(3)]
    assert [bytes(m.data) for m in found if m is not None] == [bytes([n] * 8) for n in range(3)]


def test_no_forged_frame_is_acted_on() -> None:
    """20,000 here; `python -m tests.bench.bench_forgery` makes a million."""
    came, acted, _ = forge(20_000)
    assert sum(came.values()) == 20_000
    assert acted == 0


def test_nothing_is_heard_twice_over_reboots_of_either_side() -> None:
    wire = Wire()
    sender, receiver = AuthenticatedBus(wire, KEY, 100), AuthenticatedBus(wire, KEY, 1)
    sender.send(message())
    sender.send(message())
    first, second = wire.sent
    for one, heard in ((second, True), (second, False), (first, False)):
        wire.waiting.append(one)
        assert (receiver.recv(0) is not None) == heard
    again = AuthenticatedBus(wire, KEY, 101)
    again.send(message())
    wire.waiting += [wire.sent[-1], second, wire.sent[-1]]
    assert receiver.recv(0) is not None, "a sender that has begun anew is heard"
    assert receiver.recv(0) is None, "and what it said before is not"
    assert receiver.refused["replayed"] == 4
    sender.send(message())
    wire.waiting.append(wire.sent[-1])
    assert receiver.recv(0) is not None, "one that speaks beside it goes on"
    wire.waiting += wire.sent
    assert sender.recv(0) is not None, "another's, which began later"
    assert sender.recv(0) is None, "but not what it has said itself"


def test_a_flood_of_bad_frames_takes_bounded_time() -> None:
    wire = Wire()
    bus = AuthenticatedBus(wire, KEY, 1)
    wire.waiting += [can.Message(arbitration_id=1, is_extended_id=False, is_fd=True, data=bytes(LENGTH))] * 1000
    began = time.perf_counter()
    assert bus.recv(0) is None
    assert len(wire.waiting) == 1000 - 64
    assert time.perf_counter() - began < 0.2


@pytest.mark.parametrize("kind", [{"is_fd": True}, {"is_extended_id": True}, {"is_remote_frame": True}, {"data": b"7"}])
def test_only_frames_of_the_catalogue_are_sent(kind: dict[str, object]) -> None:
    bus = AuthenticatedBus(Wire(), KEY, 1)
    wanted: dict[str, object] = {"arbitration_id": 1, "is_extended_id": False, "data": bytes(8), **kind}
    if kind.get("is_remote_frame"):
        del wanted["data"]
    with pytest.raises(ValueError, match="must be a classic data frame of 8 bytes"):
        bus.send(can.Message(**wanted))  # type: ignore[arg-type]


def key_file(folder: Path, text: str = KEY.hex(), mode: int = 0o600) -> Path:
    path = folder / "bus.key"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_a_key_is_read_from_its_owners_file_alone(tmp_path: Path) -> None:
    assert read_key(key_file(tmp_path, f"{KEY.hex()}\n")) == KEY
    assert len(read_key(key_file(tmp_path, 32 * "ab", 0o400))) == 32
    for mode in (0o640, 0o604, 0o700):
        with pytest.raises(ValueError, match=rf"chmod 600 .*got mode {mode:04o}"):
            read_key(key_file(tmp_path, mode=mode))
    for text in ("", "xy" * 16, KEY.hex()[:-2], "ab" * 5000):
        with pytest.raises(ValueError, match="must hold 32 or 64 hexadecimal digits"):
            read_key(key_file(tmp_path, text))
    (tmp_path / "link").symlink_to(key_file(tmp_path))
    for path in (tmp_path / "link", tmp_path / "none", tmp_path):
        with pytest.raises(ValueError, match=r"bus\.key_file must be a"):
            read_key(path)


def test_a_file_of_another_user_is_refused(tmp_path: Path) -> None:
    if os.getuid():
        pytest.skip("needs to be root, to give a file away")
    path = key_file(tmp_path)
    os.chown(path, 65534, 65534)
    with pytest.raises(ValueError, match="that belongs to this user"):
        read_key(path)


def test_epochs_grow_whatever_the_clock_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = key_file(tmp_path)
    kept = tmp_path / "bus.key.epoch"
    first = next_epoch(path)
    assert kept.stat().st_mode & 0o777 == 0o600
    monkeypatch.setattr(time, "time", lambda: 5.0)
    assert [next_epoch(path) for _ in range(3)] == [first + 1, first + 2, first + 3]
    for text in ("x", "-5", str(1 << 32)):
        kept.write_text(text)
        with pytest.raises(ValueError, match="must hold the last start's number"):
            next_epoch(path)
    with pytest.raises(ValueError, match="must lie where"):
        next_epoch(tmp_path / "none" / "bus.key")


def test_random_bytes_never_raise() -> None:
    wire, rng = Wire(), random.Random(1)
    bus = AuthenticatedBus(wire, KEY, 1)
    for length in (0, 1, 7, 8, 12, 16, 20, 24, 32, 48, 64):
        data = rng.randbytes(length)
        wire.waiting.append(can.Message(arbitration_id=1, is_extended_id=False, is_fd=True, data=data))
    assert bus.recv(0) is None
    assert dict(bus.refused) == {"length": 10, "forged": 1}
