"""A log's frames as MCAP: by the writer's process while a run goes on, by `sil`, as `capsule convert` has them."""

import csv
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from hil.app.main import run
from hil.formats import mcap_file
from hil.log.log import FrameLog
from hil.log.mcap_log import McapLog
from tests.hil.app.cockpit.story import CATALOGUE, story
from tests.hil.log.test_log_record import blf
from tests.places import ROOT

pytest.importorskip("mcap", reason="needs mcap (extra `mcap`)")
SECONDS = 1.0


def told(path: Path) -> dict[str, np.ndarray]:
    """The channels of an MCAP file."""
    channels = mcap_file.read(path, lambda headings: [one.name for one in headings])
    return {channel.heading.name: channel.values for channel in channels}


def test_the_writer_of_a_log_writes_both(tmp_path: Path) -> None:
    frames = story(SECONDS)
    with FrameLog(tmp_path / "a.blf", {}, mcap=tmp_path / "a.mcap") as log:
        log.put(frames)
    assert not log.troubles
    found = told(tmp_path / "a.mcap")
    assert len(found["WantedMotion/Position_m"]) == 25
    assert len(found["CapsuleLocalisation/Position_m"]) == 99  # one is spoilt
    assert run(["convert", str(tmp_path / "a.blf"), str(tmp_path / "b.mcap")]) == 0
    again = told(tmp_path / "b.mcap")
    assert set(found) == set(again)
    assert all(np.array_equal(found[name], again[name]) for name in found)


def test_what_is_in_whole_chunks_is_on_file_while_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    log = McapLog(path)
    for frame in story(3.0):
        log.write(frame)
    log.flush()
    assert path.stat().st_size > 10_000
    log.close()


def test_an_mcap_file_that_cannot_be_is_told_and_the_log_goes_on(tmp_path: Path) -> None:
    said: list[str] = []
    with FrameLog(tmp_path / "a.blf", {}, said.append, mcap=tmp_path / "no folder" / "a.mcap") as log:
        log.put(story(0.1))
    assert log.lost == 0
    assert "MCAP file is not whole: No such file or directory" in said[0]


def test_a_log_becomes_a_table_with_empty_cells(tmp_path: Path) -> None:
    log = blf(tmp_path / "a.blf", story(0.2))
    assert run(["convert", str(log), str(tmp_path / "a.csv")]) == 0
    with (tmp_path / "a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 100
    name = "CapsuleLocalisation/Position_m"
    assert [float(row["t_s"]) for row in rows if row[name]] == pytest.approx([0.01 * k for k in range(20)])
    assert "nan" not in (tmp_path / "a.csv").read_text()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["sil", "x.toml", "--mcap", "a.mcap"], "x.toml"),
        (["run", "x.toml", "--mcap", "a.csv"], "x.toml"),
    ],
)
def test_bad_words_end_with_a_sentence(words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(words) == 2
    assert sentence in capsys.readouterr().err


def test_every_topic_is_a_frame(tmp_path: Path) -> None:
    """Each frame of the catalogue that was on the bus has its topic; one that it does not know has none."""
    frames = story(0.2)
    path = tmp_path / "a.mcap"
    log = McapLog(path)
    for frame in [*frames, frames[-1]._replace(id=0x7FE)]:
        log.write(frame)
    log.close()
    assert 0x7FE not in CATALOGUE.by_id()
    assert {name.partition("/")[0] for name in told(path)} == {CATALOGUE.by_id()[frame.id].name for frame in frames}


def test_the_layout_for_plotjuggler_has_signals_that_there_are() -> None:
    layout = ElementTree.parse(ROOT / "examples" / "plotjuggler" / "capsule.xml")
    curves = [curve.attrib["name"].split("/") for curve in layout.iter("curve")]
    assert len(curves) > 10
    for frame, signal in curves:
        assert CATALOGUE[frame].field(signal)
