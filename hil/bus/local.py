"""A bus between processes of one machine without loss of frames, as a python-can interface."""

import contextlib
import fcntl
import os
import select
import socket
import struct
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import can

from hil.bus.wrapping import OwnBus
from models.files.access import private_folder

_HEAD: Final = struct.Struct("<dIB")  # time, identifier, type; the data follow
_EXTENDED, _FD, _SWITCHED = 1, 2, 4  # bits of the type
_MOST_DATA: Final = 64  # bytes of a CAN FD frame
_LONGEST_PATH: Final = 100  # characters of a socket's address
_NODES: Final = 64  # maximum number of peers
_BUFFER: Final = 1 << 20  # bytes of a socket


class LocalBus(OwnBus):
    """A node on the local bus `channel`, connected to every other node by a SEQPACKET socket, without a hub. When
    `send` returns, the frame is in the receivers' queues. A receiver that does not read loses frames that no longer
    fit, counted in the sender's `overruns`. Nodes join and leave at any time, even by SIGKILL. Not modelled:
    arbitration, bit time, errors, acknowledgement. Frames have the sender's `time.time()`.
    """

    def __init__(
        self, channel: str = "capsule", receive_own_messages: bool = False, fd: bool = False, **kwargs: Any
    ) -> None:
        """Join the bus. Raises can.CanInitializationError if that fails."""
        if not hasattr(socket, "AF_UNIX") or not hasattr(socket, "SOCK_SEQPACKET"):
            lacks = "needs AF_UNIX sockets with SOCK_SEQPACKET, which this system lacks; use interface udp_multicast"
            raise can.CanInitializationError(f"local bus {channel!r} {lacks}, or another one of python-can")
        self.overruns = 0
        self._own, self._fd = receive_own_messages, fd
        self._inbox: deque[can.Message] = deque()
        self._peers: dict[int, socket.socket] = {}
        self._poll = select.epoll()
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_NONBLOCK)
        try:
            folder = channel_folder(str(channel))
            self._address = folder / f"{os.getpid()}-{self._listener.fileno()}-{time.monotonic_ns()}"
            self._join(folder)
        except OSError as error:
            self._listener.close()
            self._poll.close()
            raise can.CanInitializationError(f"local bus {channel!r}: {error.strerror or error}") from None
        super().__init__(channel=channel, **kwargs)
        self.channel_info = f"local bus {channel}"

    def _join(self, folder: Path) -> None:
        """Connect to all sockets in the folder and add the own one; one node at a time."""
        with _locked(folder):
            for address in sorted(folder.iterdir()):
                if address.name == "lock":
                    continue
                peer = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                try:
                    peer.connect(str(address))
                except (ConnectionRefusedError, FileNotFoundError):
                    peer.close()
                    address.unlink(missing_ok=True)
                else:
                    self._add(peer)
            self._listener.bind(str(self._address))
            self._listener.listen(_NODES)
        self._poll.register(self._listener, select.EPOLLIN)

    def _add(self, peer: socket.socket) -> None:
        peer.setblocking(False)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        self._peers[peer.fileno()] = peer
        self._poll.register(peer, select.EPOLLIN)

    def _greet(self) -> None:
        while len(self._peers) < _NODES:
            try:
                peer, _ = self._listener.accept()
            except OSError:
                return
            self._add(peer)

    def _forget(self, number: int) -> None:
        peer = self._peers.pop(number, None)
        if peer is not None:
            with contextlib.suppress(OSError):
                self._poll.unregister(peer)
            peer.close()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to all other nodes; never waits. Raises ValueError for a frame of another type."""
        fit = self._fd or not (msg.is_extended_id or msg.is_fd)
        if not fit or msg.is_remote_frame or msg.is_error_frame or len(msg.data) > (_MOST_DATA if msg.is_fd else 8):
            wanted = "data frame" if self._fd else "classic data frame with an 11-bit identifier"
            raise ValueError(f"message must be a {wanted}; got {msg}")
        self._greet()
        kind = _EXTENDED * msg.is_extended_id + _FD * msg.is_fd + _SWITCHED * msg.bitrate_switch
        packet = _HEAD.pack(time.time(), msg.arbitration_id, kind) + bytes(msg.data)
        for number, peer in list(self._peers.items()):
            try:
                peer.send(packet)
            except BlockingIOError:
                self.overruns += 1
            except OSError:
                self._forget(number)
        if self._own:
            self._inbox.append(self._message(packet, is_rx=False))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._inbox:
            self._collect(timeout)
        return (self._inbox.popleft() if self._inbox else None), False

    def _collect(self, timeout: float | None) -> None:
        """Move frames that have arrived, or arrive within `timeout`, to the inbox, the oldest first."""
        end = None if timeout is None else time.monotonic() + timeout
        while True:
            left = None if end is None else max(end - time.monotonic(), 0.0)
            for number, _ in self._poll.poll(left):
                if number == self._listener.fileno():
                    self._greet()
                else:
                    self._drain(number)
            if self._inbox or (end is not None and time.monotonic() >= end):
                break
        if len(self._inbox) > 1:
            self._inbox = deque(sorted(self._inbox, key=lambda message: message.timestamp))

    def _drain(self, number: int) -> None:
        peer = self._peers[number]
        while True:
            try:
                packet = peer.recv(_HEAD.size + _MOST_DATA)
            except BlockingIOError:
                return
            except OSError:
                packet = b""
            if len(packet) < _HEAD.size:
                self._forget(number)
                return
            self._inbox.append(self._message(packet, is_rx=True))

    def _message(self, packet: bytes, is_rx: bool) -> can.Message:
        stamp, identifier, kind = _HEAD.unpack_from(packet)
        return can.Message(
            stamp,
            identifier,
            bool(kind & _EXTENDED),
            is_fd=bool(kind & _FD),
            bitrate_switch=bool(kind & _SWITCHED),
            data=packet[_HEAD.size :],
            is_rx=is_rx,
            channel=self.channel_info,
        )

    def fileno(self) -> int:
        """Readable while a frame or a joining node waits."""
        return self._poll.fileno()

    def shutdown(self) -> None:
        if self._is_shutdown:
            return
        super().shutdown()
        self._address.unlink(missing_ok=True)
        for number in list(self._peers):
            self._forget(number)
        self._listener.close()
        self._poll.close()


def channel_folder(channel: str) -> Path:
    """The folder of `channel`, created if missing; a channel with a `/` is the folder itself. Raises OSError if it
    cannot be created, belongs to others too, or has too long a path for a socket.
    """
    named = Path(tempfile.gettempdir()) / f"capsule-bus-{os.getuid()}" / channel
    folder = Path(channel).absolute() if "/" in channel else named
    if not channel or len(str(folder)) > _LONGEST_PATH - 32:
        raise OSError(f"folder must be at most {_LONGEST_PATH - 32} characters long; got {folder}")
    if "/" not in channel:
        private_folder(named.parent)
    return private_folder(folder)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    with (folder / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
