"""`capsule sil --watch`: the run is the same, in real time, and its frames are what a watcher sees."""

import threading
import time
from pathlib import Path

import can
import pytest

from hil.app.cockpit.cockpit import _source
from hil.app.cockpit.source import BusSource
from hil.app.main import run
from hil.app.scenario.bus_scenario import load_sil_scenario
from hil.app.sil.loop import run_sil
from hil.app.sil.sil import watched
from hil.app.sil.testbed import believed_on_bus
from hil.bus.local import LocalBus
from models.theta import Theta
from tests.hil.app.sil.sil_runs import Digest
from tests.hil.app.sil.test_sil import SHORT

SECONDS = 0.6


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return path


def test_a_watched_run_is_the_same_and_takes_its_time(scenario: Path, channel: str) -> None:
    loaded, _ = load_sil_scenario(scenario)
    model = believed_on_bus(loaded, Theta())
    quiet, shown_too = Digest(), Digest()
    alone = run_sil(loaded, model, "pid", 1, shown=quiet)
    with LocalBus(channel, fd=True) as watcher, watched(channel) as shown:
        began = time.monotonic()

        def both(message: can.Message) -> None:
            shown_too(message)
            shown(message)

        run_sil(loaded, model, "pid", 1, shown=both)
        took = time.monotonic() - began
        seen = 0
        while watcher.recv(0.2) is not None:
            seen += 1
    assert shown_too.told() == quiet.told()
    assert took >= SECONDS - 0.05
    assert seen == alone.frames


def test_the_cockpit_sees_the_capsule_move(scenario: Path, channel: str, tmp_path: Path) -> None:
    with _source(scenario, channel) as (source, hands):
        assert hands is None
        assert isinstance(source, BusSource)
        words = ["sil", str(scenario), "--watch", channel, "--out", str(tmp_path / "out"), "--json"]
        led = threading.Thread(target=run, args=(words,))
        led.start()
        seen: set[str] = set()
        while led.is_alive():
            source.poll()
            seen.add(next((node["state"] for node in source.document()["nodes"] if node["node"] == "controller"), ""))
            time.sleep(0.01)
        led.join()
    assert "running" in seen
    assert source.watch.last


def test_a_name_that_is_no_channel_is_refused(scenario: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sil", str(scenario), "--watch", "x" * 200]) == 2
    assert "--watch must name a local bus" in capsys.readouterr().err
