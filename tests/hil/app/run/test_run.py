"""`capsule run` without a plant: what it checks, what it refuses to lead, and in which sentence."""

import json
import threading
from pathlib import Path

import can
import pytest

from hil.app.main import run
from hil.app.scenario.deployment import load_deployment
from hil.app.scenario.rig_file import read_deployed_rig
from hil.bus.catalogue import load_catalogue
from hil.bus.local import LocalBus
from hil.bus.protection import Sender
from models.identification.model import sealed
from models.rigs.reader import read_rig
from tests.conftest import RIG
from tests.hil.app.run.deployments import deployment, rig_file


def test_a_dry_run_sends_nothing_and_says_that_it_heard_nothing(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with LocalBus(channel) as receiver:
        log = tmp_path / "dry.blf"
        assert run(["run", rig_file(tmp_path, deployment(channel)), "--dry-run", "--log", str(log), "--json"]) == 1
        found = json.loads(capsys.readouterr().out)
        assert found["ended"] == "nothing to lead: no feedback of the drive"
        assert receiver.recv(0) is None
    assert run(["replay", str(log)]) == 0


@pytest.mark.parametrize(
    ("other", "fault", "words"),
    [
        (1, 0, "drive knows another DBC"),
        (0, 4, "drive fault 4 (time to live); 'capsule run RIG.toml reset' acknowledges it"),
    ],
)
def test_a_drive_with_another_dbc_or_a_fault_is_not_led(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str], other: int, fault: int, words: str
) -> None:
    """Its heartbeat carries the fingerprint of the file it knows; a latched fault takes an operator's word."""
    catalogue = load_catalogue()
    speakers = {name: Sender(catalogue[name]) for name in ("CarriageHeartbeat", "CarriageFeedback", "CarriageFault")}
    told: dict[str, dict[str, float]] = {
        "CarriageHeartbeat": {"State": 1, "Uptime_s": 0.0, "Catalogue": catalogue.fingerprint ^ other},
        "CarriageFeedback": {
            "Position_m": 0.0,
            "Velocity_m_s": 0.0,
            "State": 7 if fault else 2,
            "Temperature_degC": 25.0,
        },
    }
    told |= {"CarriageFault": {"Code": fault, "Detail": 0}} if fault else {}
    over = threading.Event()

    def speak() -> None:
        with LocalBus(channel) as drive:
            while not over.wait(0.005):
                for frame, values in told.items():
                    data = speakers[frame].frame(values)
                    drive.send(can.Message(arbitration_id=catalogue[frame].id, is_extended_id=False, data=data))

    drive = threading.Thread(target=speak)
    drive.start()
    try:
        assert run(["run", rig_file(tmp_path, deployment(channel)), "--log", str(tmp_path / "log.blf"), "--json"]) == 1
    finally:
        over.set()
        drive.join()
    found = json.loads(capsys.readouterr().out)
    assert (found["ended"], found["overruns"]) == (f"nothing to lead: {words}", 0)


def test_check_says_what_is_missing(tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = deployment(channel, more="[limits]\ncarriage_speed_m_s = 0.5\n")
    assert run(["run", rig_file(tmp_path, text), "check", "--json"]) == 1
    found = {point["what"]: point for point in json.loads(capsys.readouterr().out)["points"]}
    assert not found["bus"]["good"]
    assert (found["drive Carriage"]["good"], found["drive Carriage"]["words"]) == (False, "nothing received")
    assert "carriage_speed_m_s must be at most 0.4" in found["limits"]["words"]
    assert found["model"]["good"]
    assert "p99" in found["time"]["words"]


def test_a_log_never_takes_the_name_of_another_file(
    tmp_path: Path, channel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = rig_file(tmp_path, deployment(channel))
    named = tmp_path / "rig.blf"
    named.write_text(Path(rig).read_text())
    assert run(["run", rig, "--dry-run", "--log", rig]) == 2
    assert "--log must be a file name that ends in .blf" in capsys.readouterr().err
    assert run(["run", str(named), "--dry-run", "--log", str(named)]) == 2
    assert "--log must not be a file that is read" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.blf", "rig.toml"]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (deployment(interface="socketcn"), "bus.interface must be one of"),
        (
            deployment(interface="socketcan", channel="nocan9"),
            "rig.toml: bus must be one that opens; got socketcan 'nocan9'",
        ),
        (deployment(interface="socketcan", channel="nocan9"), "brings it up, in a kernel with CAN"),
        (deployment(channel="y" * 150), "bus must be one that opens"),
        (deployment(interface="pcan"), "bus must be one that opens; got pcan"),
        (
            deployment(interface="pcan").replace('channel = "', 'channel = 0 # "'),
            "bus must be one that opens; got pcan 0",
        ),
        (deployment(control="tick_s = 0.5"), "control.tick_s must lie in"),
        (deployment(control="tick_s = 0.01"), "control.tick_s must be at most 0.008 s for a magnetic rig on the bus"),
        (deployment(control="core = -2"), "control.core must lie in [-1, 4095]; got -2"),
        (deployment(more="[limits]\ncarriage_speed_m_s = 0.5\n"), "carriage_speed_m_s must be at most 0.4"),
        (deployment(control="duratoin_s = 1"), "did you mean"),
        (deployment(control='controller = "mpcc"'), "rig.toml: control.controller must be one of"),
        (
            deployment(control='controller = "vibro"'),
            "control.controller must be one that leads a magnetic rig; got 'vibro'",
        ),
        (deployment(more="[bis]"), "tables must be among"),
        (deployment(more='[model]\nfile = "no.toml"\nreport = "no.json"'), "model must be a file"),
        (deployment().replace("[bus]", "[bus]\nbitrate = 500000"), "bus.bitrate must be 1000000"),
        (deployment().replace('kind = "magnetic"', 'kind = "pull"'), "must not"),
        ("x", "rig file must be TOML"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    tmp_path: Path, text: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["run", rig_file(tmp_path, text)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    if sentence != "must not":
        assert sentence in said
    assert run(["run", str(tmp_path / "none.toml")]) == 2
    assert run(["run", rig_file(tmp_path, deployment()), "chek"]) == 2
    assert "did you mean 'check'" in capsys.readouterr().err


_MODEL = """format = 1
kind = "magnetic"
[nominal]
friction_coefficient = 0.082
[calibrated]
friction_coefficient = 0.085
[augmented]
friction_coefficient = 0.085
"""


def test_a_model_leads_only_through_the_gate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.toml").write_text(sealed(_MODEL))
    (tmp_path / "report.json").write_text(
        '{"kind": "magnetic", "error": {"holdout": {"calibrated": 1.0, "augmented": 2.0}}}'
    )
    text = deployment(more='[model]\nfile = "model.toml"\nreport = "report.json"\n')
    loaded = load_deployment(Path(rig_file(tmp_path, text)))
    assert loaded.verdict is not None
    assert not loaded.verdict.passed
    assert run(["run", rig_file(tmp_path, text)]) == 2
    assert "must pass the acceptance test" in capsys.readouterr().err
    (tmp_path / "report.json").write_text(
        '{"kind": "magnetic", "error": {"holdout": {"calibrated": 1.0, "augmented": 0.5}}}'
    )
    loaded = load_deployment(Path(rig_file(tmp_path, text)))
    assert loaded.verdict is not None
    assert loaded.verdict.passed


def test_a_model_that_is_not_whole_does_not_lead(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever its report says: cut off, changed by hand, or beside another model's report."""
    text = deployment(more='[model]\nfile = "model.toml"\nreport = "report.json"\n')
    rig, whole = rig_file(tmp_path, text), sealed(_MODEL)
    report = '{"kind": "magnetic", "error": {"holdout": {"calibrated": 1.0, "augmented": 0.5}}}'
    (tmp_path / "report.json").write_text(report)

    def said(model: str) -> str:
        (tmp_path / "model.toml").write_text(model)
        assert run(["run", rig, "--log", str(tmp_path / "run.blf")]) == 2
        return capsys.readouterr().err

    for broken in (whole.rstrip()[:-1], whole.replace("0.085", "0.0851"), whole.replace("friction_coefficient", "#")):
        assert "model must be whole, as it was written with checksum" in said(broken)
    other = sealed(_MODEL + "[held_out]\naugmented = 0.4\n")
    assert "report must be the one of the model, whose held-out error is 0.4; got 0.5" in said(other)


def test_the_rig_of_a_deployment_is_that_of_its_rig_file(tmp_path: Path) -> None:
    """So that `close-loop` takes the file that the run was led with."""
    (tmp_path / "plain.toml").write_text(RIG)
    assert read_deployed_rig(Path(rig_file(tmp_path, deployment()))) == read_rig(tmp_path / "plain.toml")
    with pytest.raises(ValueError, match=r"rig\.toml: table must be one of a rig file; got 'bis'"):
        read_deployed_rig(Path(rig_file(tmp_path, deployment(more="[bis]"))))
