"""A model file that is not what was written is refused, and who changed it by hand can seal it."""

import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.identification.model import Model, read_model, sealed
from models.identification.seal import main
from models.theta import Theta
from tests.places import ROOT

VALUES = Theta({"hoop_stress_factor": 1.25, "friction_coefficient": 0.0875})
STAGES = {
    "nominal": VALUES,
    "calibrated": VALUES | {"friction_coefficient": 0.09125},
    "augmented": VALUES | {("fold_periodic", "depth"): 0.25, ("fold_periodic", "wavelength_m"): 0.0075},
}
TEXT = Model("magnetic", STAGES, "named", {"when": "now"}, {"augmented": 1e-3}).to_toml()


@given(st.integers(0, len(TEXT.rstrip()) - 1))
def test_a_file_that_was_cut_off_is_no_model(length: int) -> None:
    with pytest.raises(ValueError, match="model") as caught:
        Model.from_toml(TEXT[:length]).check_whole()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("line", [k for k, line in enumerate(TEXT.splitlines()) if line and k])
def test_a_file_without_one_of_its_lines_is_no_model(line: int) -> None:
    lines = TEXT.splitlines()
    with pytest.raises(ValueError, match="model"):
        Model.from_toml("\n".join([*lines[:line], *lines[line + 1 :]])).check_whole()


def test_comments_line_ends_and_empty_lines_change_nothing() -> None:
    assert Model.from_toml(TEXT.replace("\n", "  # x\r\n\r\n")).sealed


def test_a_file_of_an_earlier_version_is_used_and_says_that_nothing_tells_whether_it_is_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "model.toml"
    path.write_text(TEXT.partition("\n")[2])
    assert not read_model(path, "magnetic").sealed
    assert read_model(path, "magnetic").stages == STAGES
    told = capsys.readouterr().err
    assert told.startswith(f"{path}: model carries no checksum")
    assert told.count("\n") == 1
    main(path)
    assert path.read_text() == TEXT


def test_a_change_by_hand_is_sealed_by_what_the_sentence_says(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text("# mine\n" + TEXT.replace("0.0875", "0.0925"))
    with pytest.raises(ValueError, match=r"'python -m models\.identification\.seal MODEL\.toml' seals it anew"):
        read_model(path, "magnetic")
    seal = [sys.executable, "-m", "models.identification.seal", str(path)]
    assert subprocess.run(seal, check=False, cwd=ROOT).returncode == 0
    assert read_model(path, "magnetic").stages["nominal"]["friction_coefficient"] == 0.0925
    assert "# mine" in path.read_text()
    path.write_text("[")
    done = subprocess.run(seal, check=False, capture_output=True, text=True, cwd=ROOT)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def test_a_checksum_is_of_the_content_alone() -> None:
    assert sealed(sealed(TEXT)) == TEXT
