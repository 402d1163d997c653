"""`capsule replay`: the controller on its own log gives the same frames to the last bit, and a log of another
controller shows where.
"""

import json
import math
import tomllib
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final

import can
import numpy as np
import pytest

from hil.app.main import run
from hil.app.run.log_task import task_of
from hil.app.run.replay import Order, ticks_of
from hil.app.scenario.deployment import load_deployment
from hil.app.scenario.scenario import parse_track_scenario
from hil.app.sil import testbed as sil_bench
from hil.bus.catalogue import load_catalogue
from hil.log.blf_file import RECEIVED, SENT, BlfFile, Logged
from hil.log.log import LockstepLog
from hil.log.place import record_path
from hil.log.reader import read_frames
from hil.log.record import log_record
from hil.log.recorder import EXACT, START, UNSOLVED, Recorder
from models.identification import Model
from models.identification.kinds import kind_for
from models.rigs.rig import Rig
from tests.hil.app.run.deployments import PLANT, deployment, rig_file

SYNC = load_catalogue()["Sync"].id
SHORT = PLANT.replace("duration_s = 60.0", "duration_s = 1.5")
STAGE = 'stage = "augmented"\n'
FAULTS = """
[[faults]]
kind = "{kind}"
at_s = 0.7
duration_s = 0.1
"""


def logged(folder: Path, text: str = SHORT, *options: str) -> Path:
    """The log of a run over the simulated bus."""
    scenario = folder / "scenario.toml"
    scenario.write_text(text)
    assert run(["sil", str(scenario), "--out", str(folder / "out"), *options]) in (0, 1)
    return folder / "out" / "frames.blf"


@pytest.mark.parametrize(
    "fault",
    ["", "clock_jump", "late_solve", "frozen", "corrupt", "delay", "drive_reset"],
    ids=lambda kind: kind or "none",
)
def test_the_same_frames_come_out_to_the_last_bit(
    tmp_path: Path, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    log = logged(tmp_path, SHORT + (FAULTS.format(kind=fault) if fault else ""))
    capsys.readouterr()
    assert run(["replay", str(log), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["identical"]
    assert found["ticks"] >= 600
    assert found["frames"] == sum(frame.direction == SENT for frame in read_frames(log))


def test_a_predictive_controller_too(tmp_path: Path) -> None:
    assert run(["replay", str(logged(tmp_path, SHORT, "--controller", "mpc"))]) == 0


def test_the_log_of_a_run_holds_the_models_that_may_lead_on(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """All stages of its model but the one that leads, unless a stage was given by hand."""
    rig, log = rig_file(tmp_path, deployment(channel)), tmp_path / "dry.blf"
    base = kind_for(load_deployment(Path(rig)).rig, []).nominal()
    stages = {"nominal": base, "calibrated": base | {"friction_coefficient": 0.1}}
    stages["augmented"] = base | {"friction_coefficient": 0.12}
    (tmp_path / "model.toml").write_text(Model("magnetic", stages).to_toml())
    errors = {"nominal": 1e-3, "calibrated": 8e-4, "augmented": 5e-4}
    (tmp_path / "report.json").write_text(json.dumps({"error": {"holdout": errors}}))
    named = '[model]\nfile = "model.toml"\nreport = "report.json"\n'
    for more, others in ((named, {"calibrated": 0.1, "nominal": base["friction_coefficient"]}), (named + STAGE, {})):
        rig_file(tmp_path, deployment(channel, more=more))
        assert run(["run", rig, "--dry-run", "--log", str(log), "--json"]) == 1
        assert json.loads(capsys.readouterr().out)["switched"] == []
        task = task_of(json.loads(record_path(log).read_text()), str(log))
        assert {name: model.theta["friction_coefficient"] for name, model in task.others.items()} == others
        assert run(["replay", str(log)]) == 0
        capsys.readouterr()


def test_another_controller_is_told_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = logged(tmp_path)
    record = record_path(log)
    record.write_text(json.dumps({**json.loads(record.read_text()), "controller": "pid"}))
    capsys.readouterr()
    assert run(["replay", str(log)]) == 1
    said = capsys.readouterr().out
    assert "differ" in said
    assert "logged CarriageCommand" in said


def test_one_bit_of_one_command_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = logged(tmp_path)
    frames = list(read_frames(log))
    at = [k for k, frame in enumerate(frames) if frame.id == load_catalogue()["CarriageCommand"].id][400]
    frames[at] = frames[at]._replace(
        data=bytes([*frames[at].data[:3], frames[at].data[3] ^ 0x10, *frames[at].data[4:]])
    )
    file = BlfFile(log)
    for frame in frames:
        file.write(frame)
    file.stop()
    capsys.readouterr()
    assert run(["replay", str(log), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["different_ticks"] == 1


def test_a_log_that_was_cut_off_is_compared_as_far_as_it_goes_and_is_not_identical(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Anywhere, also where a block or the file would end; so is one whose run was killed, before it could say how much
    it had logged.
    """
    log = logged(tmp_path)
    frames = list(read_frames(log))

    def told() -> dict[str, Any]:
        capsys.readouterr()
        assert run(["replay", str(log), "--json"]) == 1
        return dict(json.loads(capsys.readouterr().out))

    for count in (len(frames) // 2, len(frames) // 2 + 1, len(frames) - 1):
        file = BlfFile(log)
        for frame in frames[:count]:
            file.write(frame)
        file.stop()
        found = told()
        assert (found["identical"], found["different_ticks"]) == (False, 0)
        assert found["cut_off"] == f"the log is incomplete or another one: {count} of {len(frames)} frames and notes"
    record = json.loads(record_path(log).read_text())
    assert record.pop("entries") == len(frames)
    record_path(log).write_text(json.dumps(record))
    assert "its record does not state where the log ends" in told()["cut_off"]


JUNK: Final[tuple[Any, ...]] = (None, [], {}, "", -1, 1.5, math.nan, 10**400, [1], [None], [{}], {"a": None}, [[]])


def test_junk_in_a_record_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each key of a record, and those that it might have, with each kind of junk."""
    path = tmp_path / "a.blf"
    file = BlfFile(path)
    file.write(Logged(0, SYNC, b"", SENT))
    file.stop()
    own = {"format": 2, "catalogue": load_catalogue().fingerprint, "entries": 1}
    record = {"controller": "pid", "values": {}, "scenario": SHORT, **own}
    keys = ("controller", "values", "scenario", "deployment", "format", "catalogue", "entries", "dry_run")
    for key, junk in product((*keys, "offered", "learned", "experiments"), JUNK):
        record_path(path).write_text(json.dumps({**record, key: junk}))
        status = run(["replay", str(path)])
        out, said = capsys.readouterr()
        assert "Traceback" not in said
        if status == 2:
            assert said.count("\n") == 1
            assert "a.json" in said or "a.blf" in said
        else:
            assert status == 1, (key, junk, out)
            assert junk in ({}, [], None), (key, junk, out)


def test_the_log_of_a_run_is_a_record(tmp_path: Path) -> None:
    log = logged(tmp_path)
    record = log_record(log, Rig("magnetic"))
    assert len(record) > 100
    gap = record["carriage_position_m"] - record["position_m"]
    said = json.loads((log.parent / "sil.json").read_text())
    target = parse_track_scenario(tomllib.loads(SHORT)).reference.position(np.array([1.5]))[0]
    assert np.mean(record["position_m"][-5:]) == pytest.approx(target + said["final_error_m"], abs=1e-3)
    assert np.all(np.abs(gap) < 0.02 / np.sqrt(3))
    assert np.all(np.diff(record["t_s"]) == pytest.approx(0.01, abs=2e-3))


def test_times_are_kept_to_the_last_bit(tmp_path: Path) -> None:
    time_s = 3 * 0.1
    with LockstepLog(tmp_path / "a.blf", {}) as log:
        recorder = Recorder(log)
        recorder.note(0.25, START, time_s)
        recorder.unsolved(time_s)
        recorder(can.Message(time_s, SYNC, False, data=b"1", is_rx=False))
        recorder(can.Message(time_s, 0x200, False, data=b"2", is_rx=True))
        recorder(can.Message(2.5, SYNC, False, data=b"3", is_rx=False))
    word, first, second = ticks_of(read_frames(tmp_path / "a.blf"), SYNC)
    assert word == Order(START, 0.25, time_s)
    assert not isinstance(first, Order)
    assert not isinstance(second, Order)
    assert (first.time_s, first.solved, first.sent) == (time_s, False, [(SYNC, b"1")])
    assert [m.timestamp for m in first.heard] == [time_s]
    assert (second.time_s, second.solved) == (2.5, True)
    assert {START, UNSOLVED, EXACT} == {
        f.id for f in read_frames(tmp_path / "a.blf") if f.direction not in (SENT, RECEIVED)
    }


def test_logs_without_a_task_are_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.blf"
    file = BlfFile(path)
    file.write(Logged(0, SYNC, b"", SENT))
    file.stop()
    assert run(["replay", str(path)]) == 2
    assert "record of the log must be there" in capsys.readouterr().err
    own = {"format": 2, "catalogue": load_catalogue().fingerprint}
    scenario = {"values": {}, "scenario": SHORT, **own}
    for record, sentence in (
        ({}, "format must be 2, as in this program; got None"),
        ({**own, "format": 1}, "format must be 2, as in this program; got 1"),
        ({**own, "catalogue": 7}, f"catalogue must be {own['catalogue']}, as in this program; got 7"),
        (own, "must have controller, values"),
        ({"controller": "pid", "values": {}, "deployment": "x", **own}, "must describe a task"),
        ({"controller": "pid", "values": {}, "scenario": "[rig]", **own}, "must describe a task"),
        ({"controller": "pod", **scenario}, "controller must be one of pid"),
        ({"controller": "vibro", **scenario}, "rig must be vibro for the controller 'vibro'; got 'magnetic'"),
    ):
        record_path(path).write_text(json.dumps(record))
        assert run(["replay", str(path)]) == 2
        said = capsys.readouterr().err
        assert sentence in said
        assert "a.json" in said or "a.blf" in said
        assert said.count("\n") == 1


def test_a_plan_that_the_clock_cut_short_is_cut_there_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a C compiler every second plan has no time for all its steps; the replay, which no clock presses, comes
    to the same.
    """
    monkeypatch.setenv("CAPSULE_COMPILER", "none")
    monkeypatch.setattr(sil_bench, "Task", partial(sil_bench.Task, deadline_s=2e-4))
    log = logged(tmp_path, SHORT, "--controller", "mpc")
    monkeypatch.undo()
    capsys.readouterr()
    assert run(["replay", str(log), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["cut_ticks"] > 10
