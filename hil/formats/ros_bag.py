"""Messages of topics as channels, each number named by its path; and ROS bags, decoded by their definitions."""

import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hil.formats.channels import Channel, Heading, Pick, RefusedError, check_size, library, outside
from models.files.access import check_source
from models.records.clock import in_order

MOST_ELEMENTS: Final = 64  # longest list whose elements are channels; longer ones are images, point clouds and such
_DEEPEST: Final = 12  # maximum nesting of a message
_CHECKED_EVERY: Final = 10_000  # messages between two checks of the size


@dataclass(frozen=True)
class Message:
    """One message of a `topic`: its time in ns, and its `content` as dicts, dataclasses, lists and numbers."""

    topic: str
    time_ns: int
    content: Any


def channels_of(messages: Callable[[], Iterable[Message]], pick: Pick) -> list[Channel]:
    """The channels `topic/field` that `pick` takes, at the times of headers or of messages; calls `messages` twice."""
    known: dict[str, Heading] = {}
    seen: set[str] = set()
    for message in messages():
        if message.topic not in seen:
            seen.add(message.topic)
            for name, _ in numbers_in(message.content, message.topic):
                known[name] = Heading(name, group=message.topic, clocked=True)
    chosen = [name for name in pick(list(known.values())) if name in known]
    times: dict[str, list[int]] = {name: [] for name in chosen}
    values: dict[str, list[float]] = {name: [] for name in chosen}
    topics, count = {known[name].group for name in chosen}, 0
    for message in messages():
        if message.topic not in topics:
            continue
        stamp = _stamp(message.content) or message.time_ns
        for name, value in numbers_in(message.content, message.topic):
            if name in times:
                times[name].append(stamp)
                values[name].append(value)
        count += 1
        if count % _CHECKED_EVERY == 0:
            check_size({name: len(found) for name, found in values.items()})
    start = min((found[0] for found in times.values() if found), default=0)
    return [_channel(known[name], values[name], [1e-9 * (t - start) for t in times[name]]) for name in chosen]


def _channel(heading: Heading, values: Sequence[float], times: Sequence[float]) -> Channel:
    """The channel in the order of its stamps, unless single ones are wrong or a clock begins again."""
    kept, back = in_order(stamps := np.array(times))
    order = np.argsort(stamps, kind="stable") if kept.all() and not back else slice(None)
    return Channel(heading, np.array(values)[order], stamps[order])


def numbers_in(content: Any, name: str, depth: int = 0) -> Iterator[tuple[str, float]]:
    """Each number in a message with its name."""
    if isinstance(content, bool | int | float | np.number):
        yield name, float(content)
    elif depth < _DEEPEST:
        for key, value in _parts(content):
            yield from numbers_in(value, f"{name}/{key}", depth + 1)


def _parts(content: Any) -> Iterable[tuple[Any, Any]]:
    if isinstance(content, Mapping):
        return content.items()
    if is_dataclass(content):
        return ((field.name, getattr(content, field.name)) for field in fields(content))
    if isinstance(content, np.ndarray | Sequence) and not isinstance(content, str | bytes):
        return enumerate(content) if len(content) <= MOST_ELEMENTS else ()
    return ()


def _stamp(content: Any) -> int:
    """The stamp of a message's header in ns, 0 without one."""
    stamp = _get(_get(content, "header"), "stamp") or _get(content, "timestamp")
    seconds = _get(stamp, "sec")
    rest = next((part for key in ("nanosec", "nsec", "nanos") if (part := _get(stamp, key)) is not None), 0)
    return int(seconds) * 1_000_000_000 + int(rest) if seconds is not None else 0


def _get(content: Any, key: str) -> Any:
    return content.get(key) if isinstance(content, Mapping) else getattr(content, key, None)


EXTRA = "ros"
METADATA: Final = "metadata.yaml"


def is_bag(path: Path) -> bool:
    return path.is_dir() and (path / METADATA).is_file()


def read(path: Path, pick: Pick) -> list[Channel]:
    """The fields of messages that `pick` takes, at the times of their headers or else of arrival."""
    if path.is_dir():
        for part in path.iterdir():
            _check_part(part)
    library("rosbags.highlevel", EXTRA)
    return channels_of(lambda: _messages(path), pick)


def _check_part(part: Path) -> None:
    """Refuse whatever may lead outside the bag: links, names that are addresses for SQLite, computed tables; and a
    clock that begins again, by which the library would sort.
    """
    if part.is_symlink():
        raise outside(f"{part.name} in {part.readlink()}")
    check_source(part, "part of a bag")
    if set(str(part)) & set("%?#"):
        raise RefusedError(f"names of a bag and its parts must be without %, ? and #; got {part}")
    if part.suffix == ".db3":
        with closing(sqlite3.connect(f"file:{part}?mode=ro&immutable=1", uri=True)) as tables:
            computed = "type IN ('view', 'trigger') OR sql LIKE 'CREATE VIRTUAL%'"
            found = tables.execute(f"SELECT name FROM sqlite_master WHERE {computed}").fetchone()
            if found:
                raise RefusedError(f"bag must hold plain tables; got {found[0]}, which is computed, in {part.name}")
            stamps = tables.execute("SELECT topic_id, 1e-9 * timestamp, id FROM messages ORDER BY id").fetchall()
        topics, times, rows = np.array(stamps, dtype=float).reshape(-1, 3).T
        for topic in np.unique(topics):
            if again := in_order(times[topics == topic])[1]:
                row = int(rows[topics == topic][again[0]])
                raise RefusedError(f"clock of a bag must not begin again; it does at message {row}: cut it there")


def _messages(path: Path) -> Iterator[Message]:
    typesys, highlevel = library("rosbags.typesys", EXTRA), library("rosbags.highlevel", EXTRA)
    usual = typesys.get_typestore(typesys.Stores.LATEST)
    with highlevel.AnyReader([path], default_typestore=usual) as reader:
        for connection, time_ns, data in reader.messages():
            if connection.msgtype in reader.typestore.types:
                yield Message(connection.topic, time_ns, reader.deserialize(data, connection.msgtype))


def decoder_of(name: str, definition: str) -> Callable[[bytes], Any]:
    """A decoder of messages of the type `name` with this ROS 2 definition, which includes those of its parts."""
    typesys = library("rosbags.typesys", EXTRA)
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(definition, name))
    known = next((key for key in store.types if key.replace("/msg/", "/") == name.replace("/msg/", "/")), None)
    if known is None:
        raise RefusedError(f"schema {name} must define its own type; it does not")
    return lambda data: store.deserialize_cdr(data, known)
