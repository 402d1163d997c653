"""The command line: exit statuses, one sentence for bad input, JSON alone on standard output, files complete or not at
all.
"""

from __future__ import annotations

import gzip
import json
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType, ModuleType

import numpy as np
import pytest

import hil.app.close_loop as close_loop_module
import hil.app.write as write_module
import models.identification.model as model_file
from hil.app import start
from hil.app.main import COMMANDS, run, spread_option
from hil.app.write import write_files, write_table
from models.effects import Catalogue
from models.records.record import Record, read_record
from models.rigs.rig import Rig
from tests.hil.findings import pull_finding
from tests.places import SCENARIOS

ROWS = "".join(f"{0.01 * i:.2f},{1e-4 * i:.4f},0.05\n" for i in range(200))
PULL = '[rig]\nkind = "axis"\n'


class FakeModel:
    """A model that predicts zeros."""

    kind = "axis"
    cautions: Mapping[str, str] = MappingProxyType({})
    sealed = True

    def to_toml(self) -> str:
        return 'kind = "axis"\n'

    @classmethod
    def from_toml(cls, text: str, _: Catalogue) -> FakeModel:
        if "axis" not in text:
            raise ValueError("model must have a kind; got none")
        return cls()

    def check(self, rig: Rig, record: Record) -> None:
        pass

    def check_whole(self) -> None:
        pass

    def predict(self, rig: Rig, record: Record, stage: str) -> dict[str, np.ndarray]:
        print("chatter that must not reach standard output")
        return {"t_s": record["t_s"], "force_N": np.zeros(len(record))}

    def errors(self, rig: Rig, record: Record, stage: str) -> dict[str, tuple[float, str, str]]:
        return {"force_N": (0.05, "N", "rms error")}

    def beyond(self, rig: Rig, record: Record, predicted: object) -> dict[str, object]:
        return {}


def fake_close(
    rig: Rig, train: list[Record], holdout: list[Record], progress: Callable[[str, float], None], **_: object
) -> object:
    progress("calibrating", 0.5)
    print("chatter that must not reach standard output")
    return pull_finding(seconds=2.0), FakeModel()


@pytest.fixture
def rig(tmp_path: Path) -> str:
    path = tmp_path / "rig.toml"
    path.write_text(PULL)
    return str(path)


@pytest.fixture
def record(tmp_path: Path) -> str:
    path = tmp_path / "train.csv"
    path.write_text("t_s,position_m,force_N\n" + ROWS)
    return str(path)


@pytest.fixture
def faked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(close_loop_module, "close", fake_close)
    monkeypatch.setattr(model_file, "Model", FakeModel)


def test_every_word_after_holdout_is_held_out() -> None:
    assert spread_option("--holdout", ["a", "--holdout", "b", "c", "--json"]) == [
        "a",
        "--holdout",
        "b",
        "--holdout",
        "c",
        "--json",
    ]
    assert spread_option("--holdout", ["--holdout=b", "c", "--", "d"]) == ["--holdout=b", "--holdout", "c", "--", "d"]
    assert spread_option("--holdout", ["--holdout", "--json"]) == ["--holdout", "--json"]
    assert spread_option("--holdout", ["a", "--holdout"]) == ["a", "--holdout"]


@pytest.mark.usefixtures("faked")
def test_close_loop_writes_its_three_files(
    tmp_path: Path, rig: str, record: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "deep" / "out"
    assert run(["close-loop", record, "--rig", rig, "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["model.toml", "report.html", "report.json"]
    assert json.loads((out / "report.json").read_text())["verdict"] == "named"
    said = capsys.readouterr()
    assert "What the model lacked: folds of the gut or a peristaltic wave; these records cannot tell which." in said.out
    assert "chatter" not in said.out


@pytest.mark.usefixtures("faked")
def test_json_stands_alone_on_standard_output(
    tmp_path: Path, rig: str, record: str, capsys: pytest.CaptureFixture[str]
) -> None:
    held = tmp_path / "held.csv"
    held.write_text(Path(record).read_text())
    args = ["close-loop", record, "--rig", rig, "--out", str(tmp_path / "o"), "--json", "--holdout", str(held)]
    assert run(args) == 0
    assert json.loads(capsys.readouterr().out)["error"]["holdout"]["augmented"] == 0.00091
    model = tmp_path / "o" / "model.toml"
    assert (
        run(["predict", record, "--rig", rig, "--model", str(model), "--out", str(tmp_path / "p.csv"), "--json"]) == 0
    )
    document = json.loads(capsys.readouterr().out)
    assert (document["rows"], document["stage"], document["rms"]) == (
        200,
        "augmented",
        {"force_N": pytest.approx(0.05)},
    )


def test_an_interruption_while_loading_ends_with_a_sentence(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, getattr(sys, name))

    class _Interrupted(ModuleType):
        def __getattr__(self, name: str) -> None:
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "hil.app.main", _Interrupted("hil.app.main"))
    with pytest.raises(SystemExit) as end:
        start.main()
    assert end.value.code == 130
    assert capfd.readouterr().err == "capsule: interrupted: no result was written\n"


@pytest.mark.usefixtures("faked")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interruption_leaves_nothing_behind(
    number: signal.Signals,
    tmp_path: Path,
    rig: str,
    record: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        signal.raise_signal(number)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr(close_loop_module, "close", interrupted)
    try:
        assert run(["close-loop", record, "--rig", rig, "--out", str(tmp_path / "o")]) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert not (tmp_path / "o").exists()
    assert "the same command goes on from there" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


BAD = [
    (["close-loop", "{record}", "--rig", "{rig}"], "--out"),
    (["close-loop", "--rig", "{rig}", "--out", "{tmp}/o"], "RECORD"),
    (["close-loop", "{record}", "--rig", "{tmp}/none.toml", "--out", "{tmp}/o"], "No such file"),
    (["close-loop", "{record}", "--rig", "{tmp}", "--out", "{tmp}/o"], "must be a regular file; got a directory"),
    (["close-loop", "{tmp}/none.csv", "--rig", "{rig}", "--out", "{tmp}/o"], "No such file"),
    (["close-loop", "{tmp}", "--rig", "{rig}", "--out", "{tmp}/o"], "record must be text (.csv"),
    (["close-loop", "{record}", "{record}", "--rig", "{rig}", "--out", "{tmp}/o"], "twice"),
    (["close-loop", "{record}", "--rig", "{rig}", "--out", "{tmp}/o", "--holdout", "{record}"], "twice"),
    (["close-loop", "{record}", "--rig", "{rig}", "--out", "{record}"], "--out must be a folder; got the file"),
    (["close-loop", "{record}", "--rig", "{rig}", "--out", "{record}/x"], "--out must be a folder"),
    (["close-loop", "{record}", "--rig", "{rig}", "--out", "{tmp}/o", "--seed", "x"], "--seed"),
    (["close-loop", "{record}", "--rig", "{rig}", "--out", "{tmp}/o", "--jsno"], "--jsno"),
    (
        ["predict", "{record}", "--rig", "{rig}", "--model", "{rig}", "--out", "{tmp}/p.csv", "--stage", "augmentd"],
        "did you mean 'augmented'",
    ),
    (
        ["predict", "{record}", "--rig", "{rig}", "--model", "{rig}", "--out", "{tmp}/p.txt"],
        "must be a file name that ends in .csv",
    ),
    (
        ["predict", "{record}", "--rig", "{rig}", "--model", "{tmp}/none", "--out", "{tmp}/p.csv"],
        "model must be a file that can be read",
    ),
    (
        ["predict", "{record}", "--rig", "{rig}", "--model", "{record}", "--out", "{tmp}/p.csv"],
        "train.csv: model must have a kind",
    ),
    (["simulate", "{tmp}/none.toml", "--out", "{tmp}/s.csv"], "none.toml"),
    (["sedes"], "No such command 'sedes'; did you mean 'seeds'?"),
    (["close-loop"], "see 'capsule close-loop --help'"),
    (["seeds", "--plot", "{record}"], "--plot must be a folder"),
]


@pytest.mark.usefixtures("faked")
@pytest.mark.parametrize(("args", "said"), BAD, ids=[" ".join(args)[:60] for args, _ in BAD])
def test_bad_input_ends_with_two_and_one_sentence(
    tmp_path: Path, rig: str, record: str, args: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [word.format(record=record, rig=rig, tmp=tmp_path) for word in args]
    assert run(words) == 2
    output = capsys.readouterr()
    lines = [line for line in output.err.splitlines() if line.startswith("capsule:")]
    assert len(lines) == 1
    if "--json" in words:
        assert json.loads(output.out) == {"error": lines[0].removeprefix("capsule: "), "status": 2}
    else:
        assert output.out == ""
    assert said in lines[0]
    assert "Traceback" not in output.err
    assert not (tmp_path / "p.csv").exists()


@pytest.mark.usefixtures("faked")
@pytest.mark.parametrize("command", ["close-loop", "predict"])
def test_a_folder_that_cannot_be_written_to_is_refused_before_any_work(
    tmp_path: Path,
    rig: str,
    record: str,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def read_only(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(write_module.tempfile, "TemporaryFile", read_only)
    monkeypatch.setattr(close_loop_module, "close", None)
    where = {
        "close-loop": ["--out", str(tmp_path / "o")],
        "predict": ["--model", rig, "--out", str(tmp_path / "o" / "p.csv")],
    }
    assert run([command, record, "--rig", rig, *where[command]]) == 2
    assert "must be a folder that can be written to" in capsys.readouterr().err


RECORD_FAULTS = {
    "empty": (lambda text: "", "empty file"),
    "column missing": (lambda text: text.replace("force_N", "forse_N"), "'forse_N', did you mean 'force_N'"),
    "unit": (lambda text: text.replace("position_m", "position_mm"), "'position_m', in m; got 'position_mm'"),
    "time": (lambda text: text.replace("\n0.5", "\n0.3"), "line 52: t_s must increase"),
    "not a number": (
        lambda text: text.replace("\n0.50,0.0050", "\n0.50,none at all"),
        "line 52: position_m must be a finite number",
    ),
    "short": (lambda text: text[:500], "must have"),
    "another kind": (lambda text: text.replace("force_N", "carriage_position_m"), "the columns of kind magnetic"),
}


@pytest.mark.usefixtures("faked")
@pytest.mark.parametrize("fault", RECORD_FAULTS)
def test_a_bad_record_is_refused_in_one_sentence(
    tmp_path: Path, rig: str, record: str, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil, said = RECORD_FAULTS[fault]
    bad = tmp_path / "bad.csv"
    bad.write_text(spoil(Path(record).read_text()))
    assert run(["close-loop", record, str(bad), "--rig", rig, "--out", str(tmp_path / "o"), "--json"]) == 2
    output = capsys.readouterr()
    assert output.err.count("capsule:") == 1
    assert json.loads(output.out)["error"] in output.err
    assert "bad.csv" in output.err
    assert said in output.err
    assert not (tmp_path / "o").exists()


@pytest.mark.usefixtures("faked")
@pytest.mark.parametrize(
    "spelling",
    [
        lambda text: text.replace(",", ";").encode(),
        lambda text: text.replace(",", ";").replace(".", ",").encode(),
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: gzip.compress(text.encode()),
    ],
    ids=["semicolons", "decimal commas", "byte-order mark", "gzip"],
)
def test_spellings_of_a_record_are_accepted(
    tmp_path: Path, rig: str, record: str, spelling: Callable[[str], bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.csv.gz"
    other.write_bytes(spelling(Path(record).read_text()))
    for source in (record, str(other)):
        assert run(["predict", source, "--rig", rig, "--model", rig, "--out", str(tmp_path / "p.csv"), "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["rms"] == {"force_N": pytest.approx(0.05)}


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out.startswith("capsule ")
    assert run(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(command in said for command in ("seeds", "close-loop", "predict", "simulate", "demo"))


def test_several_files_appear_together_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "old.txt").write_text("old")
    with pytest.raises(OSError, match="missing"):
        write_files({tmp_path / "old.txt": "new", tmp_path / "missing" / "b.txt": "b"})
    assert (tmp_path / "old.txt").read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old.txt", "taken"]


def test_a_table_is_written_and_packed(tmp_path: Path) -> None:
    for name in ("a.csv", "a.csv.gz"):
        write_table(tmp_path / name, {"t_s": np.arange(3.0), "x_m": np.array([1e-7, 2.0, 1 / 3])})
        assert len((tmp_path / name).read_bytes()) > 20
    assert (tmp_path / "a.csv").read_text().splitlines()[3] == "2,0.3333333333"


def test_the_example_scenario_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example = SCENARIOS / "pull_over_folds.toml"
    assert run(["simulate", str(example), "--out", str(tmp_path / "r.csv"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["record"].endswith("r.csv")
    assert len(read_record(tmp_path / "r.csv", Rig("pull"))) == 10_000


def test_a_command_keeps_small_matrices_on_one_thread() -> None:
    code = (
        "from hil.app.main import run; run(['--version']); import scipy.linalg; from threadpoolctl import"
        " threadpool_info;print([pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'])"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()[
        -1
    ]
    assert set(json.loads(said)) == {1}


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_command_has_help_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert f"Example: capsule {command}" in " ".join(said.split())


def test_a_shell_can_complete(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    assert "--install-completion" in capsys.readouterr().out
