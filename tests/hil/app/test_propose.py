"""From a residual that no known effect explains to an effect file, and to a better model with it."""

import json
from pathlib import Path

import numpy as np
import pytest

from hil.app.effects import effect_text
from hil.app.main import run
from hil.app.write import write_table

PLACE_M, WIDTH_M, FORCE_N = 0.015, 0.006, 6.0


def measured(path: Path, seed: int) -> str:
    """A stage of 10 kg that is pushed at one place: a force that the catalogue does not have."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 8, 1e-2)
    parts = zip((0.05, 0.02, 0.01), (0.21, 0.47, 0.9), rng.uniform(0, 2 * np.pi, 3), strict=True)
    x = np.sum([size * np.sin(2 * np.pi * f * t + phase) for size, f, phase in parts], axis=0)
    v = np.gradient(x, t)
    push = FORCE_N * np.exp(-0.5 * ((x - PLACE_M) / WIDTH_M) ** 2)
    force = 10 * np.gradient(v, t) + 20 * v + 8 * np.tanh(v / 1e-4) - push + 0.3 * rng.standard_normal(len(t))
    write_table(path, {"t_s": t, "position_m": x, "force_N": force})
    return str(path)


def test_a_term_proposed_from_a_residual_becomes_an_effect_that_predicts_better(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [measured(tmp_path / f"{name}.csv", seed) for seed, name in enumerate(("one", "two", "held"), start=1)]
    rig = tmp_path / "rig.toml"
    rig.write_text('[rig]\nkind = "axis"\n[noise]\nforce_std_N = 0.3\n')
    asked = ["close-loop", *names[:2], "--rig", str(rig), "--holdout", names[2], "--json"]
    assert run([*asked, "--out", str(tmp_path / "before")]) == 0
    before = json.loads(capsys.readouterr().out)
    assert before["verdict"] == "unknown"
    term = before["residual"]["term"]
    assert (term["variable"], term["along"], term["form"]) == ("x_m", "+x", "bump")
    low, high = term["numbers"]["middle"]["ci95"]
    assert low < PLACE_M < high
    assert before["residual"]["records"] == ["one", "two"]
    page = (tmp_path / "before" / "report.html").read_text()
    assert "Proposed term" in page
    own = tmp_path / "push.py"
    assert run(["effects", "propose", str(tmp_path / "before"), "--out", str(own)]) == 0
    assert run(["effects", "check", str(own)]) == 0
    capsys.readouterr()
    assert run([*asked, "--out", str(tmp_path / "after"), "--effects", str(own)]) == 0
    after = json.loads(capsys.readouterr().out)
    assert [effect["id"] for effect in after["effects"]] == ["push"]
    assert after["error"]["holdout"]["augmented"] < 0.3 * before["error"]["holdout"]["augmented"]
    assert any("proposed from the residual of one and two" in said for said in after["statements"])
    assert any(said.startswith("held had no part in the proposal") for said in after["statements"])


@pytest.mark.parametrize(
    ("report", "words"),
    [
        ({"verdict": "none"}, "got verdict 'none' and none"),
        ({"verdict": "unknown", "residual": {"term": None}}, "must have a term"),
        ({"residual": {"term": {"variable": "t_s"}}}, "must stand as close-loop writes it"),
        ({"residual": {"term": {"variable": "nonsense"}}}, "must stand as close-loop writes it"),
    ],
)
def test_a_report_without_a_term_is_refused(report: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        effect_text(report, "push", "report.json")


def test_a_name_that_is_taken_or_none_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("stribeck", "Push", "1st"):
        with pytest.raises(ValueError, match="--out must be a file named like a new effect"):
            effect_text({}, name, "report.json")
    assert run(["effects", "propose", str(tmp_path)]) == 2
    assert run(["effects", "check", "--out", str(tmp_path / "a.py")]) == 2
    assert run(["effects", "propose", str(tmp_path), "--out", str(tmp_path / "a.py")]) == 2
    assert not (tmp_path / "a.py").exists()
    assert capsys.readouterr().err.count("\n") == 3


@pytest.mark.parametrize("part", ["numbers", "given", "text", "records", "kind", "form"])
def test_no_words_of_a_report_are_run(tmp_path: Path, capsys: pytest.CaptureFixture[str], part: str) -> None:
    """A report may come from anywhere; what it says is text of the file that is made of it, never its program."""
    mark = tmp_path / "ran"
    code = f"__import__('pathlib').Path({str(mark)!r}).touch()"
    numbers = {"middle": {"value": 0.01}, "width": {"value": 0.01}}
    term = {"variable": "x_m", "along": "+x", "sized": False, "amplitude": {"value": 1.0}, "level": 1.0, "offset": 0.0}
    term |= {"numbers": numbers, "given": {}, "form": "bump", "text": "a bump"}
    left = {"term": term, "curves": [{"variable": "x_m", "centres": [0.0, 0.02]}], "records": ["one"]}
    report = {"verdict": "unknown", "kind": "axis", "residual": left, "error": {"train": {"nominal": 1.0}}}
    (tmp_path / "report.json").write_text(json.dumps(report))
    words = ["effects", "propose", str(tmp_path), "--out", str(tmp_path / "own.py")]
    assert run(words) == 0, capsys.readouterr().err
    (tmp_path / "own.py").unlink()
    if part == "numbers":
        numbers[f'a"] or {code}, x=p["a'] = {"value": 1.0}
    elif part == "given":
        term["given"] = {f"x={code}, y": 1.0}
    elif part in term:
        term[part] = f'""" + str({code}) + """\n{code}\n' + "'+" + code
    else:
        (left if part in left else report)[part] = f"'}}) or {code}"
    (tmp_path / "report.json").write_text(json.dumps(report))
    run(words)
    assert not mark.exists()
    assert "Traceback" not in capsys.readouterr().err
