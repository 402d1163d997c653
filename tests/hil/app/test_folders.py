"""Folders that others could write to, or another command has."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.app.write import sole_writer
from hil.bus.local import channel_folder
from models.compiled.cache import cache_folder
from models.compiled.private_folder import private_folder


def test_a_folder_is_for_one_command_and_goes_where_nothing_came(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with sole_writer(out, "--out"), pytest.raises(ValueError, match="another one has"), sole_writer(out, "--out"):
        pass
    assert not out.exists()
    with sole_writer(out, "--out"):
        (out / "result").write_text("")
    assert out.exists()


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
