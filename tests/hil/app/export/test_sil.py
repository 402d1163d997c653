"""An FMU as the plant of `capsule sil`: the loop that the scenario's own plant gives."""

import json
import zipfile
from pathlib import Path

import pytest

from hil.app.main import run
from tests.hil.app.export.conftest import SCENARIO

pytest.importorskip("fmpy")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def tracked(path: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, float]:
    """What `capsule sil --json` says."""
    assert run(["sil", str(path), "--json"]) == 0
    found: dict[str, float] = json.loads(capsys.readouterr().out)
    return found


def test_sil_tracks_the_same_with_its_plant_in_an_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own.toml").write_text(SCENARIO)
    (tmp_path / "other.toml").write_text(SCENARIO + '[plant]\nfmu = "p.fmu"\n')
    assert run(["export", "fmu", str(tmp_path / "own.toml"), "--out", str(tmp_path / "p.fmu")]) == 0
    capsys.readouterr()
    own, other = (tracked(tmp_path / name, capsys) for name in ("own.toml", "other.toml"))
    for key in ("tracking_rmse_m", "tracking_max_m", "final_error_m"):
        assert other[key] == pytest.approx(own[key], abs=1e-8), key
    assert other["effort"] == pytest.approx(own["effort"], rel=0.01)
    assert other["bus"] == own["bus"]


def test_fmu_with_other_variables_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "own.toml").write_text(SCENARIO)
    assert run(["export", "fmu", str(tmp_path / "own.toml"), "--out", str(tmp_path / "p.fmu")]) == 0
    with zipfile.ZipFile(tmp_path / "p.fmu") as full, zipfile.ZipFile(tmp_path / "q.fmu", "w") as other:
        for name in full.namelist():
            data = full.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'"velocity_m_s"', b'"speed"')
            other.writestr(name, data)
    (tmp_path / "other.toml").write_text(SCENARIO + '[plant]\nfmu = "q.fmu"\n')
    capsys.readouterr()
    assert run(["sil", str(tmp_path / "other.toml"), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip()
    assert "input carriage_position_m, output position_m" in said
    assert "without output velocity_m_s" in said
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("content", "said"), [(None, "not there"), (b"no archive", "must be an FMU")], ids=["missing", "no FMU"]
)
def test_what_is_no_fmu_is_refused(
    content: bytes | None, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if content is not None:
        (tmp_path / "p.fmu").write_bytes(content)
    (tmp_path / "s.toml").write_text(SCENARIO + '[plant]\nfmu = "p.fmu"\n')
    assert run(["sil", str(tmp_path / "s.toml")]) == 2
    error = capsys.readouterr().err.strip()
    assert said in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("part", "size", "said"),
    [
        ("../away.txt", 1, "its part ../away.txt lies outside it"),
        ("resources/../../away.txt", 1, "lies outside it"),
        ("/tmp/away.txt", 1, "lies outside it"),
        ("resources/zeros", 1100 << 20, "it unpacks to more than"),
    ],
    ids=["above", "above within", "absolute", "bomb"],
)
def test_an_fmu_that_unpacks_elsewhere_or_without_end_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], part: str, size: int, said: str
) -> None:
    with zipfile.ZipFile(tmp_path / "p.fmu", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        with archive.open(part, "w", force_zip64=True) as file:
            for _ in range(max(size >> 20, 1)):
                file.write(bytes(min(size, 1 << 20)))
        archive.writestr("modelDescription.xml", "<fmiModelDescription/>")
    (tmp_path / "s.toml").write_text(SCENARIO + '[plant]\nfmu = "p.fmu"\n')
    assert run(["sil", str(tmp_path / "s.toml")]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.parent.glob("away.txt"))


def test_track_has_no_fmu(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO + '[plant]\nfmu = "p.fmu"\n')
    assert run(["track", str(tmp_path / "s.toml")]) == 2
    assert "`capsule sil` reads" in capsys.readouterr().err
