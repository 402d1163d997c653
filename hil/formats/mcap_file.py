"""MCAP: topics of JSON messages, and of ROS 2 messages with their definitions in the file."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

from hil.formats.channels import Channel, Pick, RefusedError, alone, by_clock, library
from hil.formats.ros_bag import Message, channels_of, decoder_of

EXTRA = "mcap"
_UNNAMED = "record"


def read(path: Path, pick: Pick) -> list[Channel]:
    """The fields of messages that `pick` takes, at the times when they were published or stamped."""
    library("mcap.reader", EXTRA)
    with suppress(RefusedError):  # loads all that decodes ROS 2, before other files are closed off
        decoder_of("a/msg/A", "bool x")(bytes([0, 1, 0, 0, 1]))
    return channels_of(lambda: _messages(path), pick)


def _messages(path: Path) -> Iterator[Message]:
    reader = library("mcap.reader", EXTRA)
    decoders: dict[int, Callable[[bytes], Any]] = {}
    with alone(path) as file:
        messages = reader.make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        for schema, channel, message in messages:
            if channel.id not in decoders:
                decoders[channel.id] = _decoder(schema, channel)
            content = decoders[channel.id](message.data)
            yield Message(channel.topic, message.publish_time or message.log_time, content)


def _decoder(schema: Any, channel: Any) -> Callable[[bytes], Any]:
    if channel.message_encoding == "json":
        return json.loads
    if channel.message_encoding == "cdr" and schema is not None and schema.encoding == "ros2msg":
        return decoder_of(schema.name, schema.data.decode("utf-8"))
    got = channel.message_encoding
    raise RefusedError(f"topic {channel.topic} must be encoded as json, or as cdr with ros2msg schemas; got {got!r}")


def write(path: Path, channels: Sequence[Channel]) -> None:
    """Write channels as JSON messages with schemas: one topic per group and clock, one message per sample. Times are
    later by whole seconds where one is negative, which the format has not.
    """
    groups = by_clock(channels)
    late = -min((math.floor(time_s.min()) for _, time_s, _ in groups if time_s.size), default=0)
    with path.open("wb") as file:
        topics = McapTopics(file)
        for number, (group, time_s, members) in enumerate(groups):
            topic = group or (_UNNAMED if not number else f"{_UNNAMED}_{number}")
            names = [c.heading.name.removeprefix(f"{topic}/") for c in members]
            topics.add(topic, {name: c.heading.unit for name, c in zip(names, members, strict=True)})
            rows = zip(*(c.values.tolist() for c in members), strict=True)
            for at, row in zip(time_s.tolist(), rows, strict=True):
                topics.write(topic, round((at + max(late, 0)) * 1e9), dict(zip(names, row, strict=True)))
        topics.finish()


class McapTopics:
    """Writes JSON messages with schemas to an open `file`, by topic. A full chunk can be read at once."""

    def __init__(self, file: BinaryIO, chunk_bytes: int = 1 << 20) -> None:
        """Raises RefusedError if the library is not installed."""
        self._writer = library("mcap.writer", EXTRA).Writer(file, chunk_size=chunk_bytes)
        self._writer.start(profile="", library="capsule")
        self._channels: dict[str, tuple[int, count[int]]] = {}

    def add(self, topic: str, units: Mapping[str, str]) -> None:
        """Add a topic whose messages have numbers of these names and units."""
        number = {"type": "number"}
        properties = {name: number | ({"description": unit} if unit else {}) for name, unit in units.items()}
        schema = {"type": "object", "title": topic, "properties": properties}
        schema_id = self._writer.register_schema(name=topic, encoding="jsonschema", data=json.dumps(schema).encode())
        channel = self._writer.register_channel(topic=topic, message_encoding="json", schema_id=schema_id)
        self._channels[topic] = (channel, count())

    def write(self, topic: str, time_ns: int, values: Mapping[str, float]) -> None:
        """Write one message; numbers that are not finite are left out."""
        channel, sequence = self._channels[topic]
        data = json.dumps({name: value for name, value in values.items() if math.isfinite(value)}).encode()
        self._writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=data, sequence=next(sequence))

    def finish(self) -> None:
        self._writer.finish()
