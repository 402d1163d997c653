"""What a user's TOML file may be, and what is said of anything else."""

import os
from pathlib import Path

import pytest

from models.files.access import LARGEST_TEXT
from models.files.toml import read_toml


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (b"a = ", "thing must be TOML"),
        (b"a = " + b"9" * 5000, "thing must be TOML"),
        (b"a = [" * 3000, "thing must be TOML"),
        (b"a = '\xff'", "thing must be UTF-8 text; got another byte at 5"),
        (b"#" * (LARGEST_TEXT + 1), f"must be smaller than {LARGEST_TEXT} bytes"),
    ],
)
def test_what_is_no_toml_is_told_in_a_sentence(tmp_path: Path, data: bytes, sentence: str) -> None:
    file = tmp_path / "thing.toml"
    file.write_bytes(data)
    with pytest.raises(ValueError, match=r"thing\.toml: thing must") as told:
        read_toml(file, "thing")
    assert sentence in str(told.value)
    assert len(str(told.value)) < 500


def test_only_a_regular_file_is_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, sentence in ((pipe, "regular file"), (Path("/dev/zero"), "regular file"), (tmp_path, "directory")):
        with pytest.raises(ValueError, match=sentence):
            read_toml(path, "thing")
    file = tmp_path / "thing.toml"
    file.write_bytes(b"\xef\xbb\xbfa = 1\n")
    assert read_toml(file, "thing") == ({"a": 1}, "a = 1\n")
