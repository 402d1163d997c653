"""Files that other programs wrote: older MDF, ROS 2 messages in MCAP, bags and tables whose clocks begin again."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest

from hil.formats.channels import Channel, Heading, RefusedError, one_table
from hil.formats.mcap_file import write
from hil.formats.reading import read_channels
from hil.log.rig_record import read_rig_record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from tests.hil.formats.test_outside import bag, converted

T = 0.01 * np.arange(200)


def whole(path: Path) -> dict[str, Channel]:
    return {one.heading.name: one for one in read_channels(path, lambda found: [one.name for one in found])}


def test_an_mdf_3_file_is_read(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="3.30")
    file.append([asammdf.Signal(np.sin(T), T, name="x", unit="mm")])
    file.save(tmp_path / "a.mdf")
    file.close()
    found = whole(tmp_path / "a.mdf")["x"]
    assert found.values == pytest.approx(np.sin(T))
    assert found.heading.unit == "mm"


def test_messages_of_ros_2_in_mcap_are_read(tmp_path: Path) -> None:
    writer, typesys = pytest.importorskip("mcap.writer"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    float64 = store.types["std_msgs/msg/Float64"]
    with (tmp_path / "a.mcap").open("wb") as file:
        one = writer.Writer(file)
        one.start(profile="ros2")
        schema = one.register_schema(float64.__msgtype__, "ros2msg", b"float64 data\n")
        for topic in ("/x", "/y"):
            channel = one.register_channel(topic, "cdr", schema)
            for k in range(50):
                data = store.serialize_cdr(float64(float(k)), float64.__msgtype__)
                one.add_message(channel, 10_000_000 * k, bytes(data), 10_000_000 * k)
        one.finish()
    assert whole(tmp_path / "a.mcap")["/x/data"].values == pytest.approx(np.arange(50))


def test_a_bag_whose_clock_begins_again_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = bag(tmp_path / "bag")
    with sqlite3.connect(path / "bag.db3") as tables:
        tables.execute("UPDATE messages SET timestamp = timestamp - 300000000 WHERE id > 80")
    tables.close()
    assert "clock of a bag must not begin again; it does at message 81" in converted(path, capsys)[1]


def test_rows_of_two_clocks_that_begin_again_are_no_table() -> None:
    again = np.where(T < 1, T, T - 1)
    channels = [Channel(Heading(name), T, again + k * 1e-3) for k, name in enumerate(("a", "b"))]
    with pytest.raises(RefusedError, match=r"stamps of a must rise .*; got 0 s at sample 101"):
        one_table(channels)
    assert one_table(channels[:1])["t_s"] == pytest.approx(again)


def test_negative_times_are_kept_apart_in_mcap(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    write(tmp_path / "a.mcap", [Channel(Heading("x"), T, T - 0.5)])
    times = whole(tmp_path / "a.mcap")["record/x"].time_s
    assert times is not None
    assert np.diff(times) == pytest.approx(0.01)


def test_samples_that_a_file_marks_as_invalid_are_told(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    bad = (T > 0.495) & (T < 0.525)
    file = asammdf.MDF(version="4.10")
    place = asammdf.Signal(np.where(bad, 9.0, T), T, name="position_m", unit="m", invalidation_bits=bad)
    file.append([place, asammdf.Signal(T, T, name="force_N", unit="N")])
    file.save(tmp_path / "a.mf4")
    file.close()
    record = read_rig_record(tmp_path / "a.mf4", Rig("pull"))
    assert record["position_m"] == pytest.approx(T)
    assert [(one.why, one.column) for one in record.left_out] == [("no_number", "position_m")]
    assert "3 of 200 samples" in record.left_out[0].sentence


def test_a_structure_of_simulink_without_time_is_read_at_a_stated_rate(tmp_path: Path) -> None:
    scipy = pytest.importorskip("scipy.io")
    signals = {"values": np.column_stack([T, np.sin(T)]), "label": "log", "dimensions": 2.0}
    scipy.savemat(tmp_path / "a.mat", {"out": {"time": np.empty(0), "signals": signals}})
    columns = {"t_s": {"rate_Hz": 100.0}, "position_m": "log(:,1)", "force_N": "log(:,2)"}
    record = read_rig_record(tmp_path / "a.mat", parse_rig({"rig": {"kind": "axis"}, "columns": columns}))
    assert record["t_s"] == pytest.approx(T)
    assert record["force_N"] == pytest.approx(np.sin(T))
