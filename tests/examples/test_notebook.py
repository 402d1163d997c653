"""The notebook runs from its first cell to its last, and its two forms say the same."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from tests.places import ROOT

FOLDER = ROOT / "examples" / "notebook"


def cells(script: str) -> list[tuple[str, str]]:
    """Kind and source of each `# %%` cell of a script."""
    parts = re.split(r"^# %%(.*)$\n", script, flags=re.M)[1:]
    found = []
    for mark, source in zip(parts[::2], parts[1::2], strict=True):
        text = source.strip()
        words = "[markdown]" in mark
        found.append(("markdown", re.sub(r"^# ?", "", text, flags=re.M)) if words else ("code", text))
    return found


def notebook(script: str) -> dict[str, Any]:
    """The script as a Jupyter notebook without outputs."""
    made: list[dict[str, Any]] = []
    for number, (kind, source) in enumerate(cells(script)):
        cell: dict[str, Any] = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}}
        cell |= {"execution_count": None, "outputs": []} if kind == "code" else {}
        made.append(cell | {"source": source.splitlines(keepends=True)})
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}


def test_script_and_notebook_are_the_same() -> None:
    script = (FOLDER / "identify.py").read_text(encoding="utf-8")
    assert json.loads((FOLDER / "identify.ipynb").read_text(encoding="utf-8")) == notebook(script)


def test_every_cell_runs(capsys: pytest.CaptureFixture[str]) -> None:
    document = json.loads((FOLDER / "identify.ipynb").read_text(encoding="utf-8"))
    names: dict[str, Any] = {}
    for cell in document["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    said = capsys.readouterr().out
    assert "named ['fold_periodic']" in said
    assert "rms error" in said
