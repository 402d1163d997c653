"""Folders that others could write to, or another command has."""

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from hil.app.main import run
from hil.app.write import file_trouble, sole_writer, write_files
from hil.bus.local import channel_folder
from hil.log.blf_file import SENT, BlfFile, Logged
from hil.log.place import write_record
from models.files.access import cache_folder, private_folder


def test_a_folder_is_for_one_command_and_goes_where_nothing_came(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with (
        sole_writer(out, "--out"),
        pytest.raises(ValueError, match="no other command writes"),
        sole_writer(out, "--out"),
    ):
        pass
    assert not out.exists()
    with sole_writer(tmp_path / "above" / "below", "--out"):
        pass
    assert not (tmp_path / "above").exists()
    with sole_writer(out, "--out"):
        (out / "result").write_text("")
    assert out.exists()


@contextmanager
def full_at(size: int) -> Iterator[None]:
    """No file larger than `size` bytes, as on a disk that is full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_what_does_not_fit_on_the_disk_is_named_and_nothing_half_is_left(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text("before")
    with full_at(1000), pytest.raises(OSError, match=r"page\.html") as found:
        write_files({tmp_path / "numbers.json": "1", page: "x" * 2000})
    assert file_trouble(found.value).startswith(f"{page} must be")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    assert page.read_text() == "before"
    log = BlfFile(tmp_path / "run.blf")
    for number in range(1000):
        log.write(Logged(10_000_000 * number, number, bytes(8), SENT))
    with full_at(200), pytest.raises(OSError, match=r"run\.blf"):
        log.flush()
    log.file.close()


def test_a_command_that_fails_leaves_no_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, wrong = tmp_path / "a" / "b", tmp_path / "wrong.toml"
    wrong.write_text("[rig]\nkind = 'none'\n")
    for args in (["track", str(wrong)], ["sil", str(wrong)], ["design", str(wrong)], ["campaign", str(wrong)]):
        assert run([*args, "--out", str(out)]) == 2
        assert "wrong.toml" in capsys.readouterr().err
        assert not out.parent.exists()


def test_a_folder_that_others_can_write_to_is_not_used(
    short_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wide = short_path / "wide"
    wide.mkdir()
    wide.chmod(0o777)
    link = short_path / "link"
    link.symlink_to(short_path)
    for folder in (wide, link):
        with pytest.raises(OSError, match="must be"):
            private_folder(folder)
    with pytest.raises(OSError, match="write to it"):
        channel_folder(f"{wide}/")
    monkeypatch.setenv("CAPSULE_CACHE", str(wide))
    assert cache_folder() == cache_folder() != wide
    assert capsys.readouterr().err.count("compiled code is not kept in") == 1
    assert private_folder(short_path / "new").stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("mask", [0o077, 0o027, 0o022])
def test_who_may_read_a_result_is_as_the_umask_has_it(short_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        write_files({short_path / "a.json": "{}"})
        write_files({short_path / "b.toml": ""})
        write_record(short_path / "c.blf", {})
    finally:
        os.umask(before)
    modes = {path.stat().st_mode & 0o777 for path in short_path.iterdir()}
    assert modes == {0o666 & ~mask}
    assert len(list(short_path.iterdir())) == 3
