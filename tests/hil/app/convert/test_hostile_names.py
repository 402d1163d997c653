"""Names from files are words: no formula of a spreadsheet, no script of a page, no order to a terminal."""

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.app.console import json_text, notes, printable
from hil.app.main import run
from hil.app.write import table_text
from hil.formats.channels import Channel, Heading
from hil.formats.reading import write_channels
from models.files.csv_reader import read_table
from models.files.csv_text import guarded, unguarded

FORMULAS = (
    "=cmd|' /C calc'!A0",
    "+1+cmd",
    "-2+3+cmd",
    "@SUM(1+1)*cmd",
    "'=cmd",
    "''-x",
    "x;=cmd|'/C calc'!A0",
    'x";=cmd',
    "\uff1dcmd",
    "x,=cmd",
)
MARKUP = ("<img src=x onerror=alert(1)>", "</script><script>alert(1)</script>", "<!--<script>", "[/b]", "[bold red]x")
ORDERS = "a\x1b]0;owned\x07b\x9b31mc\u202ed"
T = 0.01 * np.arange(200)


def opens(cell: str) -> bool:
    """Whether a spreadsheet takes a cell for a formula."""
    return cell.lstrip(" ").startswith(("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20"))


def parquet(path: Path, names: Sequence[str]) -> Path:
    pytest.importorskip("pyarrow")
    channels = [Channel(Heading("t_s"), T), *(Channel(Heading(name), np.sin(T)) for name in names)]
    path.write_bytes(write_channels(path, channels))
    return path


def header_of(path: Path) -> list[str]:
    return read_table(path, lambda names, units: ()).header


@pytest.mark.parametrize("name", FORMULAS)
def test_no_header_is_a_formula_and_all_are_read_back(tmp_path: Path, name: str) -> None:
    """Whatever the spreadsheet takes for the separator; numbers stay as they are."""
    source, out, again = parquet(tmp_path / "a.parquet", [name]), tmp_path / "o.csv", tmp_path / "p.csv"
    assert run(["convert", str(source), str(out)]) == 0
    first, second = out.read_text().splitlines()[:2]
    assert second.split(",")[0] == "0"
    for separator in (",", ";", "\t"):
        cells = next(csv.reader([first], delimiter=separator))
        assert not any(opens(cell) for cell in cells), cells
    assert run(["convert", str(out), str(again)]) == 0
    assert again.read_bytes() == out.read_bytes()
    if '"' not in name:
        assert header_of(out) == ["t_s", name]


def test_numbers_keep_their_sign() -> None:
    text = table_text({"x": np.array([-1.5, 2.0]), "-y": np.array([0.0, -1e-9])})
    assert text == "x,'-y\n-1.5,0\n2,-1e-09\n"


@given(st.text(max_size=20))
def test_a_guarded_name_is_no_formula_and_comes_back(name: str) -> None:
    assert unguarded(guarded(name)) == name
    assert not any(opens(cell) for cell in re.split('[;,\t\r\n"]', guarded(name)))


@pytest.mark.parametrize("name", MARKUP)
def test_no_name_is_part_of_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    source, page = parquet(tmp_path / "a.parquet", [name, "other"]), tmp_path / "page.html"
    named = tmp_path / f"{name.replace('/', '')}.parquet"
    source.rename(named)
    assert run(["plot", str(named), "--out", str(page)]) == 0
    text = page.read_text()
    body = re.sub(r'<script type="application/gzip".*?</script>', "", text, flags=re.DOTALL)
    assert "<img" not in body
    assert "alert(1)" not in re.sub(r'<script type="application/json">.*?</script>', "", body, flags=re.DOTALL).replace(
        "&lt;script&gt;alert(1)", ""
    ).replace("onerror=alert(1)&gt;", "")
    assert "<!--" not in body
    assert "Traceback" not in "".join(capsys.readouterr())


def test_no_name_commands_a_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = parquet(tmp_path / "a.parquet", [ORDERS, "other"])
    odd = tmp_path / f"{ORDERS}.parquet"
    odd.write_bytes(source.read_bytes())
    broken = tmp_path / f"{ORDERS}.csv"
    broken.write_text("nothing")
    for words in ((str(odd),), (str(odd), "--json"), (str(broken),)):
        run(["convert", words[0], str(tmp_path / "o.csv"), *words[1:]])
        said = "".join(capsys.readouterr())
        assert "owned" in said
        assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", said)
    assert not re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]", (tmp_path / "o.csv").read_text())


def test_a_console_takes_no_markup(capsys: pytest.CaptureFixture[str]) -> None:
    notes().print("a[/b] [bold]c[/bold] :smile:")
    assert capsys.readouterr().err == "a[/b] [bold]c[/bold] :smile:\n"
    assert printable("plain words, ü µ °\n") == "plain words, ü µ °\n"
    assert json_text({"a": "\x9b"}) == '{\n  "a": "\\u009b"\n}\n'
