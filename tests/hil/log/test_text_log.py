"""Text logs give the record of the log itself: candump's screen, dates, differences, negative stamps of ASC."""

from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from hil.log.blf_file import Logged
from hil.log.record import log_record
from models.rigs.rig import Rig
from tests.hil.log.test_log_record import MAGNETIC, blf, frames

FRAMES = frames(MAGNETIC)
START = 1.7e9


def data(one: Logged) -> str:
    return " ".join(f"{byte:02X}" for byte in one.data)


def screen(stamp: str, one: Logged) -> str:
    return f" ({stamp})  can0  {one.id:03X}   [{len(one.data)}]  {data(one)}"


def steps(one: Logged) -> float:
    k = FRAMES.index(one)
    return one.time_s - FRAMES[max(k - 1, 0)].time_s


TEXTS: dict[str, Callable[[Logged], str]] = {
    "file": lambda one: f"({START + one.time_s:.6f}) can0 {one.id:03X}#{one.data.hex()}",
    "file, differences": lambda one: f"({steps(one):010.6f}) can0 {one.id:03X}#{one.data.hex()}",
    "screen": lambda one: screen(f"{START + one.time_s:.6f}", one),
    "screen, dates": lambda one: screen(f"{datetime.fromtimestamp(START + one.time_s):%Y-%m-%d %H:%M:%S.%f}", one),
    "screen, differences": lambda one: screen(f"{steps(one):010.6f}", one) + "  '........'",
}


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_gives_the_record_of_the_log(tmp_path: Path, text: str) -> None:
    wanted = log_record(blf(tmp_path / "a.blf", FRAMES), Rig("magnetic"))
    (tmp_path / "a.log").write_text("\n".join(map(TEXTS[text], FRAMES)) + "\n")
    found = log_record(tmp_path / "a.log", Rig("magnetic"))
    assert len(found) == len(wanted)
    assert found["position_m"] == pytest.approx(wanted["position_m"], abs=1e-9)
    assert np.diff(found["t_s"]) == pytest.approx(np.diff(wanted["t_s"]), abs=3e-6)
    assert any("differences" in note for note in found.notes) == ("differences" in text)


def asc(path: Path, form: str, stamps: Sequence[float]) -> Path:
    """`FRAMES` at `stamps` that are absolute or relative."""
    head = ["date Sun Mar 1 12:30:00.000 2026", f"base hex  timestamps {form}", "internal events logged"]
    pairs = zip(stamps, FRAMES, strict=True)
    rows = [f"{at:10.6f} 1  {one.id:X}             Rx   d {len(one.data)} {data(one)}" for at, one in pairs]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def test_asc_with_negative_stamps_has_all_its_frames(tmp_path: Path) -> None:
    found = log_record(asc(tmp_path / "a.asc", "absolute", [one.time_s - 1 for one in FRAMES]), Rig("magnetic"))
    wanted = log_record(blf(tmp_path / "a.blf", FRAMES), Rig("magnetic"))
    assert found["t_s"] + 1 == pytest.approx(wanted["t_s"], abs=3e-6)


def test_asc_of_differences_is_summed(tmp_path: Path) -> None:
    found = log_record(asc(tmp_path / "a.asc", "relative", [steps(one) for one in FRAMES]), Rig("magnetic"))
    wanted = log_record(blf(tmp_path / "a.blf", FRAMES), Rig("magnetic"))
    assert found["t_s"] == pytest.approx(wanted["t_s"], abs=3e-6)
    assert any("differences" in note for note in found.notes)


def test_a_screen_without_stamps_and_strange_lines_are_told(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    path.write_text("\n".join(screen("", one).replace("()", "") for one in FRAMES))
    with pytest.raises(ValueError, match=r"frames must have stamps; .* candump -ta"):
        log_record(path, Rig("magnetic"))
    path.write_text("\n".join(["user@rig:~$ candump -ta can0", *map(TEXTS["screen"], FRAMES)]))
    assert any("1 of 1200 lines" in note and "line 1" in note for note in log_record(path, Rig("magnetic")).notes)


def test_refused_frames_are_counted(tmp_path: Path) -> None:
    kept = [one for k, one in enumerate(FRAMES) if not 400 <= k < 460]
    twice = [one for one in kept for _ in range(2)]
    found = log_record(blf(tmp_path / "a.blf", twice), Rig("magnetic"))
    assert {one.why for one in found.left_out} >= {"refused"}
    assert len(found) > 180
    assert "repeated" in next(one.sentence for one in found.left_out if one.why == "refused")


def test_a_line_that_is_cut_off_is_told(tmp_path: Path) -> None:
    head = [";$FILEVERSION=1.1", ";$STARTTIME=46000.5", ";"]
    rows = [
        f"{k:6d})  {1e3 * one.time_s:11.1f}  Rx         {one.id:04X}  {len(one.data)}  {data(one)} "
        for k, one in enumerate(FRAMES, 1)
    ]
    text = "\r\n".join([*head, *rows])
    (tmp_path / "a.trc").write_text(text[:-15])
    (note,) = log_record(tmp_path / "a.trc", Rig("magnetic")).notes
    assert f"1 of {len(FRAMES)} lines" in note
