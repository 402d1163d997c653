"""The notebook runs from its first cell to its last, and its two forms say the same."""

import contextlib
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil import api
from models.identification.finding import NEXT_CSV, NEXT_TOML
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


@pytest.fixture(scope="module")
def ran() -> tuple[dict[str, Any], str]:
    """What stands in the notebook's names after its last cell, and what it printed."""
    document = json.loads((FOLDER / "identify.ipynb").read_text(encoding="utf-8"))
    names: dict[str, Any] = {}
    with contextlib.redirect_stdout(io.StringIO()) as said:
        for cell in document["cells"]:
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    return names, said.getvalue()


@pytest.mark.slow
def test_every_cell_runs(ran: tuple[dict[str, Any], str]) -> None:
    said = ran[1]
    assert "named ['fold_periodic']" in said
    assert "rms error" in said


def test_what_it_found_predicts_from_its_file(ran: tuple[dict[str, Any], str], tmp_path: Path) -> None:
    found, rig, held = (ran[0][name] for name in ("found", "rig", "held_out"))
    written = found.write(tmp_path)
    names = {path.name for path in written}
    assert names - {NEXT_CSV, NEXT_TOML} == {"report.html", "report.json", "model.toml"}
    model = api.load_model(tmp_path / "model.toml", "pull")
    predicted = api.predict(model, rig, held)["force_N"]
    assert predicted.shape == held["force_N"].shape
    assert np.sqrt(np.mean((predicted - held["force_N"]) ** 2)) < 5e-3
