"""`capsule check`: status, findings as text and as JSON, and that `close-loop` heeds them."""

import json
from pathlib import Path

import numpy as np
import pytest

from hil.app.main import run
from tests.models.checks.test_examine import NOISE, Columns, clipped, pull, turned
from tests.rig_texts import GUT

RIG = f'[rig]\nkind = "pull"\n[noise]\nforce_std_N = {NOISE}\n{GUT}'


def written(folder: Path, columns: Columns, rig: str = RIG) -> list[str]:
    names = list(columns)
    rows = [",".join(names), *(",".join(f"{v:.9g}" for v in row) for row in zip(*columns.values(), strict=True))]
    (folder / "one.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    return [str(folder / "one.csv"), "--rig", str(folder / "rig.toml")]


def test_a_clean_record_has_status_0_and_nothing_to_tell(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["check", *written(tmp_path, pull()), "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["findings"] == []


def test_a_turned_sign_stops_with_the_file_and_the_remedy(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    options = written(tmp_path, turned(pull()))
    assert run(["check", *options]) == 1
    said = capfd.readouterr()
    assert "force sign" in said.out + said.err
    assert "sign = -1" in said.out + said.err
    assert run(["close-loop", *options, "--out", str(tmp_path / "out")]) == 2
    said = capfd.readouterr()
    assert "opposes the motion" in said.err
    assert not [*(tmp_path / "out").glob("*")]


def test_the_remedy_as_written_into_the_rig_file_mends_the_record(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    corrected = RIG + '\n[columns]\nforce_N = {column = "force_N", sign = -1}\n'
    assert run(["check", *written(tmp_path, turned(pull()), corrected), "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["findings"] == []


def test_clipping_is_told_with_its_place_and_does_not_stop(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["check", *written(tmp_path, clipped(pull())), "--json"]) == 0
    (finding,) = json.loads(capfd.readouterr().out)["findings"]
    assert finding["id"] == "clipping"
    assert finding["severity"] == "weakens"
    assert "line" in finding["where"]


def test_stamps_that_begin_again_stop_with_their_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    columns = pull()
    columns["t_s"] = np.where(np.arange(len(columns["t_s"])) < 3000, columns["t_s"], columns["t_s"] - 15.0)
    options = written(tmp_path, columns)
    assert run(["check", *options, "--json"]) == 1
    found = json.loads(capfd.readouterr().out)["findings"]
    assert found[0]["id"] == "stamps_restart"
    assert "3002" in found[0]["where"] + found[0]["remedy"]
    assert run(["close-loop", *options, "--out", str(tmp_path / "out")]) == 2


def test_records_that_stop_have_a_page_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    columns = pull()
    columns["t_s"] = np.where(np.arange(len(columns["t_s"])) < 3000, columns["t_s"], columns["t_s"] - 15.0)
    options = written(tmp_path, columns)
    assert run(["check", *options, "--out", str(tmp_path / "out")]) == 1
    assert f"report: {tmp_path / 'out' / 'check.html'}" in capsys.readouterr().out
    page = (tmp_path / "out" / "check.html").read_text(encoding="utf-8")
    assert "the worst stops a fit" in page
    assert "force in N" in page
    assert json.loads((tmp_path / "out" / "check.json").read_text())["findings"][0]["id"] == "stamps_restart"
    (tmp_path / "check.json").write_text((tmp_path / "one.csv").read_text())
    own = [str(tmp_path / "check.json"), *options[1:]]
    assert run(["check", *own, "--out", str(tmp_path)]) == 2
    assert "which would be overwritten" in capsys.readouterr().err


def test_a_file_that_is_no_record_has_status_2(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    options = written(tmp_path, pull())
    (tmp_path / "one.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    assert run(["check", *options]) == 2
    assert len(capfd.readouterr().err.strip().splitlines()) == 1


def test_the_smallest_sizes_that_would_show_grow_with_the_noise_and_have_the_unit_of_the_effect(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    quiet = json.loads(_checked(written(tmp_path, pull()), capfd))["smallest_detectable"]
    noisy = written(tmp_path, pull(), RIG.replace(f"force_std_N = {NOISE}", f"force_std_N = {6 * NOISE}"))
    found = json.loads(_checked(noisy, capfd))
    sizes, hidden = found["smallest_detectable"], found["cannot_show"]
    assert {"fold_periodic", "respiration", "stribeck"} <= sizes.keys() <= quiet.keys()
    assert all("none of the sizes" in hidden[name] for name in quiet.keys() - sizes.keys())
    share = 6 / np.sqrt(10)  # ten samples are averaged where there is so much noise
    assert all(0.8 < sizes[name] / quiet[name] / share < 1.2 for name in ("fold_periodic", "respiration", "stribeck"))
    assert run(["check", *noisy]) == 0
    row = next(line for line in capfd.readouterr().out.splitlines() if "breathing force" in line)
    assert row.rstrip(" ┃│|").endswith("N")


def _checked(options: list[str], capfd: pytest.CaptureFixture[str]) -> str:
    assert run(["check", *options, "--json"]) == 0
    return capfd.readouterr().out
