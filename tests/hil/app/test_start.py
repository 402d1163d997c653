"""What a command loads before its first word: a missing file and a wrong option are told before anything large."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from hil.app.main import COMMANDS, GROUPS, run

HEAVY = ("numba", "llvmlite", "scipy", "plotly", "jinja2", "can", "cantools", "pandas", "asammdf", "control")
MISSING = {
    "check": "{none}.csv --rig {none}.toml",
    "close-loop": "{none}.csv --rig {none}.toml --out o",
    "plot": "{none}.csv",
    "convert": "{none}.csv o.csv",
    "predict": "{none}.csv --rig {none}.toml --model m.toml --out o.csv",
    "export": "fmu {none}.toml --out o.fmu",
    "simulate": "{none}.toml --out o.csv",
    "design": "{none}.toml",
    "track": "{none}.toml",
    "sil": "{none}.toml",
    "run": "{none}.toml",
    "plant": "{none}.toml",
    "jog": "{none}.toml",
}
LARGE = {
    "check": ("scipy.stats", "scipy.signal", "asammdf", "pandas", "can", "control"),
    "init": ("scipy.stats", "models.identification.search", "controller", "can", "plotly"),
    "plot": ("scipy.stats", "scipy.signal", "asammdf", "pandas", "control"),
    "convert": ("scipy.stats", "asammdf", "pandas", "plotly", "control"),
    "predict": ("scipy.stats", "asammdf", "pandas", "can", "control"),
    "run.replay": ("scipy.stats", "asammdf", "pandas", "plotly", "control"),
    "simulate": ("scipy.stats", "scipy.optimize", "controller", "can", "plotly"),
}


def loaded(code: str) -> tuple[set[str], int]:
    """The modules that a new process has loaded at the end of `code`, and how many."""
    said = subprocess.run(
        [sys.executable, "-c", f"import json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"],
        capture_output=True, text=True, check=True,
    ).stdout  # fmt: skip
    names = json.loads(said.splitlines()[-1])
    return set(names), len(names)


@pytest.mark.parametrize("command", MISSING)
def test_a_missing_file_is_told_before_anything_large_is_loaded(command: str) -> None:
    words = [command, *MISSING[command].format(none="none").split()]
    modules, count = loaded(f"from hil.app.main import run\nassert run({words!r}) == 2")
    assert not modules & set(HEAVY)
    assert count < 700


def test_a_wrong_option_is_told_before_anything_large_is_loaded() -> None:
    calls = "\n".join(f"assert run([{command!r}, '--wrong']) == 2" for command in COMMANDS)
    modules, _ = loaded(f"from hil.app.main import run\n{calls}")
    assert not modules & set(HEAVY)


@pytest.mark.parametrize("command", LARGE)
def test_a_command_loads_what_it_needs_alone(command: str) -> None:
    modules, _ = loaded(f"import hil.app.{command}")
    assert not modules & set(LARGE[command])


def test_help_has_each_command_on_a_line_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sorted(name for names in GROUPS.values() for name in names) == sorted(COMMANDS)
    for name in COMMANDS:
        assert len([line for line in lines if line.split()[:1] == [name] and len(line) <= 79]) == 1
    assert not [line for line in lines if "..." in line and "COMMAND" not in line]


def test_words_after_holdout_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [tmp_path / name for name in ("held.csv", "swallowed.csv", "rig.toml")]
    for path in files:
        path.write_text("")
    words = ["--holdout", str(files[0]), str(files[1]), "--rig", str(files[2]), "--out", str(tmp_path / "o")]
    assert run(["close-loop", *words]) == 2
    said = capsys.readouterr().err
    assert f"held out, as each word after --holdout: {files[0]} and {files[1]}" in said
    assert "RECORD" in said
