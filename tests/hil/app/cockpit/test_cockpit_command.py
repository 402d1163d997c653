"""What cannot be used is one sentence and status 2."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from hil.app.cockpit import cockpit as module
from hil.app.cockpit.source import LogSource
from hil.app.main import run
from hil.app.scenario.deployment import parse_deployment
from hil.log.blf_file import RECEIVED, Logged
from hil.log.log import LockstepLog
from hil.log.recorder import log_record
from hil.nodes.frame_map import frames
from models.theta import Theta
from tests.hil.app.cockpit.story import story
from tests.hil.app.run.deployments import deployment, rig_file
from tests.hil.log.test_log_record import blf

pytest.importorskip("tornado", reason="needs tornado (extra `cockpit`)")


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The sentence with which the command ends."""
    assert run(["cockpit", *words, "--port", "0"]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("capsule: ")
    assert len(error.splitlines()) == 1
    return error


def test_bad_sources(tmp_path: Path, capsys: pytest.CaptureFixture[str], channel: str) -> None:
    assert "no such file" in said(capsys, str(tmp_path / "none.toml")).lower()
    (tmp_path / "x.csv").write_text("a")
    assert "must be a deployment file (.toml) or a CAN log" in said(capsys, str(tmp_path / "x.csv"))
    (tmp_path / "x.blf").write_bytes(b"nonsense")
    assert "x.blf: log must be one in the format" in said(capsys, str(tmp_path / "x.blf"))
    strange = blf(tmp_path / "strange.blf", [Logged(0, 0x7FE, bytes(8), RECEIVED)])
    assert "must hold good frames of capsule.dbc; got none" in said(capsys, str(strange))
    other = rig_file(tmp_path, deployment("no_such_interface_0", interface="socketcan"))
    assert "bus must be one that opens; got socketcan" in said(capsys, other)


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    assert "pip install '.[cockpit]'" in said(capsys, "x.toml")


def test_a_port_out_of_range(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["cockpit", "x.toml", "--port", "70000"]) == 2
    assert "--port must lie in [0, 65535]; got 70000" in capsys.readouterr().err


def test_a_log_with_its_record_says_what_the_model_is_made_of(tmp_path: Path) -> None:
    values = Theta.of({"friction_coefficient": 0.09, ("fold_periodic", "depth"): 0.2})
    text = deployment()
    parsed = parse_deployment(text, values)
    record = log_record({"deployment": text}, "feedforward", values, parsed.limits, frames())
    record |= {"ended": "localisation lost", "remedy": "check the localiser"}
    with LockstepLog(tmp_path / "run.blf", record) as log:
        log.put(story(1.0))
    with module._source(tmp_path / "run.blf") as (source, operator):
        assert operator is None
        assert isinstance(source, LogSource)
        model = source.facts.models[0]
        assert source.watch.events[-1].words == "the run ended: localisation lost: check the localiser"
    assert model["made"] == "base + fold_periodic"
    assert model["kind"] == "learned"
    assert ["friction_coefficient", "0.09", "0.082"] in model["rows"]
    assert any(row[0] == "depth" for row in model["rows"])


def test_no_request_carries_the_token_of_the_address(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What stands behind the # stays in the browser."""
    from hil.app.cockpit import server

    tokens: list[str] = []
    monkeypatch.setattr(server, "serve", lambda page, *_: tokens.append(page.token))
    monkeypatch.setattr(module.os, "nice", lambda _: 0)
    module.cockpit(Path(rig_file(tmp_path, deployment(channel))), port=0, json_output=True)
    told = json.loads(capsys.readouterr().out)
    assert told["address"] == f"{told['watch_only']}#token={tokens[0]}"


TAKEN = """
const bar = { hash: "HASH", search: "SEARCH", pathname: "/" }, kept = { token: "KEPT" };
globalThis.location = bar;
globalThis.history = { replaceState: (state, title, path) => { bar.hash = bar.search = ""; bar.pathname = path; } };
globalThis.sessionStorage = { setItem: (key, value) => { kept[key] = value; }, getItem: key => kept[key] || null };
FUNCTION
console.log(JSON.stringify([tokenOf(), bar.pathname + bar.search + bar.hash, kept.token]));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize(
    ("hash_", "search", "kept", "found"),
    [
        ("#token=abc", "", "", ["abc", "/", "abc"]),
        ("", "?token=abc", "", ["abc", "/", "abc"]),
        ("", "", "abc", ["abc", "/", "abc"]),
        ("#token=new", "", "old", ["new", "/", "new"]),
        ("", "", "", ["", "/", ""]),
    ],
)
def test_the_token_leaves_the_address_bar(hash_: str, search: str, kept: str, found: list[str]) -> None:
    """The page's own function, with a browser's parts put in its place."""
    script = (Path(module.__file__).parent / "cockpit.js").read_text()
    function = re.search(r"function tokenOf\(\) \{.*?^\}", script, re.DOTALL | re.MULTILINE)
    assert function is not None
    text = TAKEN.replace("FUNCTION", function[0])
    text = text.replace("HASH", hash_).replace("SEARCH", search).replace("KEPT", kept)
    told = subprocess.run(["node", "-e", text], capture_output=True, text=True, check=True)
    assert json.loads(told.stdout) == found
