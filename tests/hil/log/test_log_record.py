"""CAN logs as records: columns on one time base, at the times the values were true; sentences for logs that are
none.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import can
import numpy as np
import pytest

import models.identification.model as model_file
from hil.app.main import run
from hil.bus.catalogue import load_catalogue
from hil.bus.protection import Sender
from hil.log.blf_file import RECEIVED, SENT, WITHHELD, BlfFile, Logged
from hil.log.record import SOURCES, log_record
from hil.log.rig_record import read_rig_record
from models.records.record import USED
from models.rigs.kinds import KINDS
from models.rigs.rig import Rig
from tests.hil.app.test_cli import FakeModel

CATALOGUE = load_catalogue()
Timed = tuple[float, str, Mapping[str, float]]


def place(t: float) -> float:
    """Where the carriage is."""
    return 0.02 * np.sin(3 * t)


def feedback(t: float) -> Timed:
    return t, "CarriageFeedback", {"Position_m": place(t), "Velocity_m_s": 0.0, "State": 4, "Temperature_degC": 25}


def localisation(t: float, age: float = 0.008, valid: int = 1) -> Timed:
    return t, "CapsuleLocalisation", {"Position_m": 0.5 * place(t - age), "Quality": 1.0, "Age_s": age, "Valid": valid}


def force(t: float, age: float = 0.004) -> Timed:
    return t, "ForceReading", {"Force_N": 10 * place(t - age), "Age_s": age, "Valid": 1}


def level(t: float, value: float, mode: int = 2, life: int = 10, period: float = 0.0) -> Timed:
    return t, "InnerMassCommand", {"Level": value, "Period_s": period, "Duty": 0.5, "TimeToLive_ms": life, "Mode": mode}


def frames(timed: Iterable[Timed], way: int = RECEIVED) -> list[Logged]:
    """Protected frames in order of time."""
    senders = {name: Sender(frame) for name, frame in CATALOGUE.frames.items()}
    ordered = sorted(timed, key=lambda one: one[0])
    return [Logged(round(1e9 * t), CATALOGUE[name].id, senders[name].frame(values), way) for t, name, values in ordered]


def blf(path: Path, logged: Iterable[Logged]) -> Path:
    file = BlfFile(path)
    for one in logged:
        file.write(one)
    file.stop()
    return path


MAGNETIC = [*(feedback(0.002 * k) for k in range(1000)), *(localisation(0.01 * k + 0.0013) for k in range(1, 200))]


def test_values_stand_at_the_times_when_they_were_true(tmp_path: Path) -> None:
    record = log_record(blf(tmp_path / "run.blf", frames(MAGNETIC)), Rig("magnetic"))
    assert set(record.columns) == {"t_s", "carriage_position_m", "position_m"}
    assert len(record) == 199
    assert record.name == "run"
    t = record["t_s"]
    np.testing.assert_allclose(t, 0.01 * np.arange(1, 200) + 0.0013 - 0.008, atol=1e-9)
    np.testing.assert_allclose(record["carriage_position_m"], 0.02 * np.sin(3 * t), atol=3e-7)
    np.testing.assert_allclose(record["position_m"], 0.01 * np.sin(3 * t), atol=1.1e-7)


def test_vector_ascii_gives_the_same_record(tmp_path: Path) -> None:
    logged = frames(MAGNETIC)
    with can.ASCWriter(tmp_path / "run.asc") as writer:
        for one in logged:
            writer.on_message_received(can.Message(1.7e9 + one.time_s, one.id, False, data=one.data, channel=0))
    binary, text = (
        log_record(tmp_path / name, Rig("magnetic")) for name in (blf(tmp_path / "run.blf", logged).name, "run.asc")
    )
    np.testing.assert_allclose(text["t_s"] - text["t_s"][0], binary["t_s"] - binary["t_s"][0], atol=2e-6)
    np.testing.assert_array_equal(text["position_m"], binary["position_m"])


@pytest.mark.parametrize("kind", ["pull", "axis"])
def test_a_pull_is_the_carriage_and_the_force(tmp_path: Path, kind: str) -> None:
    timed = [*(feedback(0.002 * k) for k in range(500)), *(force(0.002 * k + 0.001) for k in range(2, 500))]
    record = log_record(blf(tmp_path / "a.blf", frames(timed)), Rig(kind))
    np.testing.assert_allclose(record["force_N"], 0.2 * np.sin(3 * record["t_s"]), atol=6e-6)
    np.testing.assert_allclose(record["position_m"], 0.02 * np.sin(3 * record["t_s"]), atol=3e-7)


def test_what_nobody_vouches_for_is_left_out(tmp_path: Path) -> None:
    spoilt = [
        *MAGNETIC[:1000],
        *(localisation(0.01 * k + 0.0013, valid=int(k % 2)) for k in range(1, 240)),
    ]
    logged = frames(spoilt)
    number = CATALOGUE["CapsuleLocalisation"].id
    bad = [
        Logged(x.time_ns + 1000, x.id, bytes([x.data[0] ^ 1]) + x.data[1:], x.direction)
        for x in logged
        if x.id == number
    ]
    twice = [Logged(x.time_ns + 2000, x.id, x.data, x.direction) for x in logged if x.id == number]
    only = log_record(blf(tmp_path / "a.blf", logged), Rig("magnetic"))
    with_bad = log_record(blf(tmp_path / "b.blf", sorted([*logged, *bad, *twice])), Rig("magnetic"))
    assert len(only) == 100
    for name in only.columns:
        np.testing.assert_array_equal(only[name], with_bad[name])


def test_a_held_drive_is_the_mean_since_the_row_before(tmp_path: Path) -> None:
    """On for the first half of every 20 ms; commands every 2 ms; places every 10 ms at 3 ms after a command began to
    act, and rows in between as often as commands.
    """
    commands = [level(0.002 * k, 1.0 if (k // 5) % 2 == 0 else 0.0) for k in range(1200)]
    places = [localisation(0.01 * k + 0.003, age=0.0) for k in range(1, 230)]
    record = log_record(blf(tmp_path / "a.blf", frames([*commands, *places], SENT)), Rig("vibro"))
    assert record[USED].tolist() == [1.0, *[0.0, 0.0, 0.0, 0.0, 1.0] * 228]
    edges = {0: [1.0, 1.0, 1.0, 0.5, 0.0], 1: [0.0, 0.0, 0.0, 0.5, 1.0]}
    for k, row in enumerate(np.flatnonzero(record[USED])[:-1]):
        np.testing.assert_allclose(record["drive_on"][row + 1 : row + 6], edges[(k + 1) % 2], atol=1e-3)
    total = np.sum(record["drive_on"][1:] * np.diff(record["t_s"]))
    assert total == pytest.approx(0.5 * (record["t_s"][-1] - record["t_s"][0]), abs=0.005)


def test_a_drive_is_off_where_its_command_dies_or_does_not_enable(tmp_path: Path) -> None:
    commands = [level(0.002 * k, 1.0, mode=2 if k < 500 else 1) for k in range(1000) if not 100 <= k < 200]
    places = [localisation(0.01 * k + 0.003, age=0.0) for k in range(1, 200)]
    record = log_record(blf(tmp_path / "a.blf", frames([*commands, *places])), Rig("vibro"))
    t, on = record["t_s"], record["drive_on"]
    assert np.all(on[(t > 0.25) & (t < 0.39)] == 0)
    assert np.all(on[t > 1.02] == 0)
    np.testing.assert_allclose(on[(t > 0.02) & (t < 0.19)], 1.0)


def test_the_sources_are_frames_of_the_catalogue_and_columns_of_records() -> None:
    for kind, sources in SOURCES.items():
        for source in (sources.driven, sources.measured):
            assert CATALOGUE[source.frame].field(source.signal)
        assert sources.driven.column in {name for names in KINDS[kind].layout.driven for name in names}
        assert sources.measured.column in KINDS[kind].layout.measured


@pytest.mark.parametrize(
    ("timed", "kind", "sentence"),
    [
        (
            MAGNETIC,
            "coil",
            r"must hold CoilFeedback frames \(0x190 of capsule.dbc\); got CapsuleLocalisation, CarriageFeedback",
        ),
        (MAGNETIC[:1000], "magnetic", "must hold CapsuleLocalisation frames"),
        ([], "magnetic", "got no frame of the catalogue"),
        (MAGNETIC, "dma", "must be of a rig of kind pull"),
        ([*MAGNETIC[:1000], *MAGNETIC[1000:1050]], "magnetic", "must have at least 100 rows; got 50"),
        ([*MAGNETIC[:1000], localisation(0.5, valid=0)], "magnetic", "must hold values with Valid 1; got none"),
        ([level(0.1, -1.0), localisation(0.2)], "vibro", r"Level must lie in \[0, 1\]"),
        ([level(0.1, 1.0, period=0.02), localisation(0.2)], "vibro", "must hold a level"),
    ],
)
def test_a_log_of_something_else_is_one_sentence(tmp_path: Path, timed: list[Timed], kind: str, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        log_record(blf(tmp_path / "a.blf", frames(timed)), Rig(kind))


def test_a_log_of_another_catalogue_is_one_sentence(tmp_path: Path) -> None:
    wrong = [Logged(x.time_ns, x.id, bytes([x.data[0] ^ 0x55]) + x.data[1:], x.direction) for x in frames(MAGNETIC)]
    with pytest.raises(ValueError, match=r"as capsule.dbc describes them; all were refused: 1000 for crc"):
        log_record(blf(tmp_path / "a.blf", wrong), Rig("magnetic"))
    beat = (0.0, "CarriageHeartbeat", {"State": 2, "Uptime_s": 1.0, "Catalogue": CATALOGUE.fingerprint ^ 1})
    with pytest.raises(ValueError, match="with fingerprint"):
        log_record(blf(tmp_path / "b.blf", frames([beat, *MAGNETIC])), Rig("magnetic"))


def test_frames_that_were_never_sent_are_no_data(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="got no frame of the catalogue"):
        log_record(blf(tmp_path / "a.blf", frames(MAGNETIC, WITHHELD)), Rig("magnetic"))


def test_a_prediction_needs_the_drive_alone(tmp_path: Path) -> None:
    record = log_record(blf(tmp_path / "a.blf", frames(MAGNETIC[:1000])), Rig("magnetic"), driven_only=True)
    assert set(record.columns) == {"t_s", "carriage_position_m"}
    assert len(record) == 1000


def test_csv_records_are_read_as_ever(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t_s,position_m,force_N\n" + "".join(f"{0.01 * k:.2f},0.0,0.1\n" for k in range(120)))
    assert len(read_rig_record(path, Rig("axis"))) == 120


def test_the_command_line_predicts_from_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(model_file, "Model", FakeModel)
    rig, model, out = tmp_path / "rig.toml", tmp_path / "model.toml", tmp_path / "out.csv"
    rig.write_text('[rig]\nkind = "axis"\n')
    model.write_text('kind = "axis"\n')
    timed = [*(feedback(0.002 * k) for k in range(500)), *(force(0.002 * k + 0.001) for k in range(2, 500))]
    log = blf(tmp_path / "a.blf", frames(timed))
    assert run(["predict", str(log), "--rig", str(rig), "--model", str(model), "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rows"] == 498
    assert found["rms"]["force_N"] == pytest.approx(0.2 / np.sqrt(2), rel=0.2)
    assert run(["predict", str(tmp_path / "no.blf"), "--rig", str(rig), "--model", str(model), "--out", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
