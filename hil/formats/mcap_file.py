"""MCAP: topics of JSON messages, and of ROS 2 messages where the file has their definitions."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from hil.formats.channels import Channel, Pick, RefusedError, library
from hil.formats.clock import by_clock
from hil.formats.messages import Message, channels_of
from hil.formats.ros_bag import decoder_of

EXTRA = "mcap"
_UNNAMED = "record"


def read(path: Path, pick: Pick) -> list[Channel]:
    """The fields of messages that `pick` takes, at the times when they were published or stamped."""
    library("mcap.reader", EXTRA)
    return channels_of(lambda: _messages(path), pick)


def _messages(path: Path) -> Iterator[Message]:
    reader = library("mcap.reader", EXTRA)
    decoders: dict[int, Callable[[bytes], Any]] = {}
    with path.open("rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            if channel.id not in decoders:
                decoders[channel.id] = _decoder(schema, channel)
            content = decoders[channel.id](message.data)
            yield Message(channel.topic, message.publish_time or message.log_time, content)


def _decoder(schema: Any, channel: Any) -> Callable[[bytes], Any]:
    if channel.message_encoding == "json":
        return json.loads
    if channel.message_encoding == "cdr" and schema is not None and schema.encoding == "ros2msg":
        return decoder_of(schema.name, schema.data.decode("utf-8"))
    raise RefusedError(
        f"topic {channel.topic} must be encoded as json, or as cdr with ros2msg schemas; got"
        f" {channel.message_encoding!r}"
    )


def write(path: Path, channels: Sequence[Channel]) -> None:
    """Write channels as JSON messages with schemas: a topic a group and clock, a message a sample."""
    writer_module = library("mcap.writer", EXTRA)

    with path.open("wb") as file:
        writer = writer_module.Writer(file)
        writer.start(profile="", library="capsule")
        for number, (group, time_s, members) in enumerate(by_clock(channels)):
            _write_topic(writer, group or (_UNNAMED if not number else f"{_UNNAMED}_{number}"), time_s, members)
        writer.finish()


def _write_topic(writer: Any, topic: str, time_s: Any, members: Sequence[Channel]) -> None:
    names = [c.heading.name.removeprefix(f"{topic}/") for c in members]
    rows = zip(*(c.values.tolist() for c in members), strict=True)
    properties = {
        name: {"type": "number", **({"description": c.heading.unit} if c.heading.unit else {})}
        for name, c in zip(names, members, strict=True)
    }
    schema = {"type": "object", "title": topic, "properties": properties}
    number = writer.register_schema(name=topic, encoding="jsonschema", data=json.dumps(schema).encode())
    channel = writer.register_channel(topic=topic, message_encoding="json", schema_id=number)
    for sequence, (at, row) in enumerate(zip(time_s.tolist(), rows, strict=True)):
        stamp = max(round(at * 1e9), 0)
        told = {name: value for name, value in zip(names, row, strict=True) if math.isfinite(value)}
        data = json.dumps(told).encode()
        writer.add_message(channel, log_time=stamp, publish_time=stamp, data=data, sequence=sequence)
