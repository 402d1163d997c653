"""No process of this program runs what lies in the folder that its user stands in."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hil.app.cockpit.operator_panel import OperatorPanel
from hil.app.cockpit.panels import Facts
from hil.app.cockpit.source import BusSource
from hil.app.run.clock import Clock
from hil.bus.local import LocalBus
from hil.formats.channels import Channel, Heading
from hil.formats.reading import write_channels
from hil.log.log import FrameLog
from hil.log.record import file_channels
from hil.nodes.frame_map import FRAME_MAPS
from tests.hil.app.cockpit.story import CATALOGUE
from tests.places import ROOT

MODULES = ("hil", "signal", "struct", "json", "random", "resource", "can", "numpy", "typer", "sitecustomize")


@pytest.fixture
def mark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What is written by any module of the current folder that is run."""
    folder, mark = tmp_path / "here", tmp_path / "ran"
    folder.mkdir()
    text = f"import os\nos.close(os.open({str(mark)!r}, os.O_CREAT))\n"
    for name in MODULES:
        (folder / f"{name}.py").write_text(text)
    (folder / ".numba_config.yaml").write_text("cache_dir: kept\ncache_locator_classes: json\n")
    monkeypatch.chdir(folder)
    return mark


def start_of_the_cockpit(folder: Path) -> None:
    channel = f"own-{os.getpid()}"
    with LocalBus(channel) as bus:
        source = BusSource(bus, Clock(), Facts("test", "", FRAME_MAPS["magnetic"], CATALOGUE))
        operator = OperatorPanel(source, folder / "none.toml", None)
        assert operator.asked(object(), {"ask": "start"}) == ""
        until = time.monotonic() + 60.0
        while operator.document(object())["run"] and time.monotonic() < until:
            operator.cycle()
            time.sleep(0.05)
        operator.close()
    said = [event.words for event in source.watch.events]
    assert any("none.toml" in words and "capsule run ended" in words for words in said), said


def reader_of_a_record(folder: Path) -> None:
    channels = [Channel(Heading(name), np.arange(9.0)) for name in ("t_s", "x")]
    (folder / "a.parquet").write_bytes(write_channels(folder / "a.parquet", channels))
    assert len(file_channels(folder / "a.parquet")) == 2


def writer_of_a_log(folder: Path) -> None:
    log = FrameLog(folder / "a.blf", {})
    log.close()
    assert not log.troubles


@pytest.mark.parametrize("task", [start_of_the_cockpit, reader_of_a_record, writer_of_a_log])
def test_modules_of_the_current_folder_are_not_run(tmp_path: Path, mark: Path, task: Callable[[Path], None]) -> None:
    task(tmp_path)
    assert not mark.exists()


BEGUN = """
import multiprocessing, sys
import hil.app.start as start
if __name__ == "__main__":
    start.leave_current_folder()
    child = multiprocessing.get_context("spawn").Process(target=print, args=("child",))
    child.start()
    child.join()
    import numba
    print(repr(numba.config.CACHE_DIR), repr(numba.config.CACHE_LOCATOR_CLASSES))
"""


def test_children_and_compiled_code_are_not_of_the_current_folder(tmp_path: Path, mark: Path) -> None:
    """Of `learn`, `demo` and `campaign`, and of numba, which reads settings there."""
    script = tmp_path / "script.py"
    script.write_text(BEGUN)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    for name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES", "PYTHONSAFEPATH"):
        environment.pop(name, None)
    told = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=environment, check=True)
    assert told.stdout.split() == ["child", "''", "''"]
    assert not mark.exists()
