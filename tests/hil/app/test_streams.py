"""Full, closed and unread outputs: the outcome of a command is what it is, its status tells, and nobody sees a
traceback.
"""

import os
import sys
from pathlib import Path
from typing import Final

import pytest

from hil.app.system import UNWRITTEN
from tests.hil.app.run.deployments import PLANT, deployment
from tests.hil.app.run.forked import LONGEST_S, SERVER

FULL: Final = Path("/dev/full")
pytestmark = pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")


class Started:
    """A command as started from a shell, with standard output and error each a file, "full", "closed", or "unread":
    a pipe that nobody reads.
    """

    def __init__(self, folder: Path, *words: str, out: str = "file", err: str = "file") -> None:
        self.files = [folder / f"started.{name}" for name in ("out", "err")]
        for file in self.files:
            file.write_text("")
        self.process = SERVER.Process(target=_work, args=(folder, words, self.files, (out, err)), daemon=True)
        self.process.start()

    def ended(self) -> tuple[int, str, str]:
        """Its status, and what came on both."""
        self.process.join(LONGEST_S)
        assert self.process.exitcode is not None
        out, err = (file.read_text() for file in self.files)
        return self.process.exitcode, out, err


def _work(folder: Path, words: tuple[str, ...], files: list[Path], ways: tuple[str, str]) -> None:
    from hil.app.start import main

    os.chdir(folder)
    sys.argv = ["capsule", *words]
    for number, file, way in zip((1, 2), files, ways, strict=True):
        if way == "closed":
            os.close(number)
            setattr(sys, ("", "stdout", "stderr")[number], None)
        elif way == "unread":
            reads, writes = os.pipe()
            os.dup2(writes, number)
            os.close(reads)
            os.close(writes)
        else:
            handle = os.open(FULL if way == "full" else file, os.O_WRONLY | os.O_APPEND)
            os.dup2(handle, number)
            os.close(handle)
    main()


def words_of(command: str, folder: Path, channel: str) -> list[str]:
    """A short one of each command that is long by nature, and of one that is not."""
    scenario, deployed, jog = folder / "plant.toml", folder / "deployed.toml", folder / "jog.txt"
    scenario.write_text(PLANT.replace("duration_s = 60.0", "duration_s = 0.6"))
    tables = '[operator]\naccept = true\n[plant]\nscenario = "plant.toml"\n'
    deployed.write_text(deployment(channel, more=tables))
    jog.write_text("release 0.1\n")
    return {
        "sil": ["sil", str(scenario)],
        "track": ["track", str(scenario)],
        "plant": ["plant", str(deployed), "--seconds", "0.2"],
        "run": ["run", str(deployed), "--log", str(folder / "run.blf")],
        "check": ["run", str(deployed), "check"],
        "jog": ["jog", str(deployed), "--script", str(jog), "--source", "script"],
        "seeds": ["seeds"],
    }[command]


STATUS: Final = {"run": 1, "check": 1, "jog": 1}
"""Of those that hear nobody; the others end with 0."""


@pytest.mark.parametrize("command", ["sil", "track", "plant", "run", "check", "jog", "seeds"])
@pytest.mark.parametrize("more", [(), ("--json",)], ids=["words", "json"])
def test_an_output_that_takes_nothing(command: str, more: tuple[str, ...], tmp_path: Path, channel: str) -> None:
    status = STATUS.get(command, 0)
    ways = [("file", "full"), ("file", "closed"), ("full", "file"), ("closed", "file"), ("unread", "file")]
    started = []
    for k, (out, err) in enumerate([*ways, ("full", "full")]):
        folder = tmp_path / str(k)
        folder.mkdir()
        started.append(Started(folder, *words_of(command, folder, f"{channel}{k}"), *more, out=out, err=err))
    ended = [one.ended() for one in started]
    for (_, err), (found, out, _) in zip(ways[:2], ended[:2], strict=True):
        assert found == status, err
        assert out.strip(), err
        assert "Traceback" not in out
    whys = ("No space left", "Bad file", "Broken pipe")
    for why, (found, _, said) in zip(whys, ended[2:5], strict=True):
        assert found == (status or UNWRITTEN), said
        assert said.splitlines()[-1].startswith("capsule: standard output must take the result; got: " + why)
        assert "Traceback" not in said
    assert ended[5][0] == (status or UNWRITTEN)


def test_bad_input_is_status_2_whatever_the_outputs(tmp_path: Path) -> None:
    for out, err in (("file", "full"), ("full", "file"), ("closed", "closed"), ("unread", "unread")):
        assert Started(tmp_path, "sil", "no_such_file.toml", out=out, err=err).ended()[0] == 2
