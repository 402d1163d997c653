"""Files that other programs wrote: older MDF, ROS 2 messages in MCAP, bags and tables whose clocks begin again."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest

from hil.formats.channels import Channel, Heading, RefusedError, one_table
from hil.formats.mcap_file import write
from hil.formats.reading import read_channels
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
