"""ROS bags: a folder with metadata.yaml, or one file; messages are decoded by their definitions."""

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final

from hil.formats.channels import Channel, Pick, RefusedError, library, outside
from hil.formats.messages import Message, channels_of
from models.files.access import check_source

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
    """Refuse whatever may lead outside the bag: links, names that are addresses for SQLite, computed tables."""
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
