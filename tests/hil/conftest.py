"""What tests of the bus between processes share."""

from __future__ import annotations

from collections.abc import Iterator
from uuid import uuid4

import pytest

from hil.bus.local import channel_folder


@pytest.fixture
def channel() -> Iterator[str]:
    """A name for a local bus of this test alone; its sockets are gone afterwards."""
    name = f"test-{uuid4().hex[:12]}"
    yield name
    folder = channel_folder(name)
    for place in folder.iterdir():
        place.unlink()
    folder.rmdir()
