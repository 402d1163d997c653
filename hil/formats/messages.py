"""Messages of topics (JSON objects, ROS messages) as channels: each number in them, named by its path."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Final

import numpy as np

from hil.formats.channels import Channel, Heading, Pick, check_size
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
