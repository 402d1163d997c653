"""Mutation testing of the guard: every small change to its functions must make a test of `tests/hil/test_guard*.py`
fail.

`python -m tests.bench.bench_mutation [FILE.py TEST.py...]` with the package mutmut (3.8 was used); it works on a copy,
prints each survivor's change and how many there were, and ends with 1 where one is not among the `EQUIVALENT` ones,
which no test can tell from the original.
"""

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
PACKAGES: Final = ("models", "controller", "plant", "hil", "tests")
GUARD = "hil/nodes/guard.py"
TESTS: Final = ("tests/hil/nodes/test_guard.py", "tests/hil/nodes/test_guard_passed.py")
SETTINGS: Final = """[tool.mutmut]
source_paths = ["hil"]
only_mutate = ["{source}"]
also_copy = ["models", "controller", "plant"]
pytest_add_cli_args = ["-p", "no:cacheprovider", "--noconftest"]
pytest_add_cli_args_test_selection = {tests}
use_git_change_detection = false

[tool.pytest.ini_options]
filterwarnings = ["ignore"]
markers = ["slow: long"]
"""
EQUIVALENT: Final[Mapping[str, str]] = {
    "+    dt = min(dt, 2 * fence.tick_s) if dt >= 0 else 0.0": "at dt = 0 both give 0",
    '+    why = "late" if missed else "" if abs(held - aim) < 1e-9 * (fence.high - fence.low) else "limit"': (
        "differs where a command misses its aim by exactly 1e-9 of the range, and in the word alone, not in what leaves"
    ),
    "+        self._stopped_at = +math.inf": (
        "the age of a stop is -inf instead of inf: neither lies within the period, so it is told"
    ),
}
"""The line of a survivor that does not matter, and why."""


def main() -> int:
    """Mutate, test, list what survived."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", nargs="?", default=GUARD)
    parser.add_argument("tests", nargs="*", default=TESTS)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder)
        for package in PACKAGES:
            shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
        (copy / "pyproject.toml").write_text(SETTINGS.format(source=options.source, tests=json.dumps(options.tests)))
        done = _mutmut(copy, "run", "--max-children", "1")
        results = _mutmut(copy, "results", "--all", "true")
        counts: dict[str, int] = {}
        for state in re.findall(r"^\s+\S+__mutmut_\d+: (.+)$", results, re.M):
            counts[state] = counts.get(state, 0) + 1
        survivors = re.findall(r"^\s+(\S+__mutmut_\d+): (?!killed)", results, re.M)
        changes = {name: _change(_mutmut(copy, "show", name)) for name in survivors}
    if not counts:
        print(done[-3000:])
        return 1
    print(", ".join(f"{number} {state}" for state, number in sorted(counts.items())))
    for name, change in changes.items():
        print(f"{name}\n{change}\n  {_why(change)}")
    return int(any(not _why(change) for change in changes.values()))


def _mutmut(folder: Path, *arguments: str) -> str:
    command = [sys.executable, "-m", "mutmut", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def _why(change: str) -> str:
    """Why a survivor does not matter, "" where it does."""
    return next((why for line, why in EQUIVALENT.items() if line in change.splitlines()), "")


def _change(shown: str) -> str:
    """The changed line of a mutant."""
    return "\n".join(line for line in shown.splitlines() if re.match(r"[+-](?![+-])", line))


if __name__ == "__main__":
    sys.exit(main())
