"""What tests of the bus and of the command line share."""

from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

import pytest

from hil.bus.local import channel_folder
from tests.hil.app.campaign.campaigns import campaign_files
from tests.hil.app.run.forked import SERVER
from tests.hil.app.track.track_texts import SHORT


@pytest.fixture
def channel() -> Iterator[str]:
    """A name for a local bus of this test alone; its sockets are gone afterwards."""
    name = f"test-{uuid4().hex[:12]}"
    yield name
    folder = channel_folder(name)
    for place in folder.iterdir():
        place.unlink()
    folder.rmdir()


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Two seconds of a magnetic traverse."""
    path = tmp_path / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return path


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    return campaign_files(tmp_path)


@pytest.fixture
def loaded_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers of a campaign or a demo are forked from a server that has loaded the program; else each loads it anew."""
    for place in ("hil.app.campaign.worker", "hil.app.demo.demo"):
        monkeypatch.setattr(f"{place}.get_context", lambda _: SERVER)
