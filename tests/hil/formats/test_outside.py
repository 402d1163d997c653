"""A record that points outside itself is refused with one sentence, in bounded time, and nothing of what it points at
comes out; whole records of the same kinds are read.
"""

import os
import shutil
import sqlite3
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil.app.main import run
from hil.formats.channels import Channel, Heading
from hil.formats.reading import FORMATS, LOGS, write_channels
from models.files.csv_reader import ENDINGS

T = 0.01 * np.arange(100)
SECRET = "something that is nobody's business "
LONGEST_S = 20.0
OUTSIDE = "record must hold all that belongs to it itself; got"


def converted(path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """The status of `capsule convert` and what it says, in bounded time; a refusal is one line and writes nothing."""
    out, began = path.parent / "out.parquet", time.monotonic()
    out.unlink(missing_ok=True)
    status = run(["convert", str(path), str(out)])
    said = capsys.readouterr().err.strip()
    assert time.monotonic() - began < LONGEST_S
    assert out.exists() == (status == 0)
    if status:
        assert status == 2
        assert said.startswith(f"capsule: {path}")
        assert "\n" not in said
        assert SECRET.strip() not in said
    return status, said


def fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def secret(folder: Path) -> Path:
    path = folder / "secret.txt"
    path.write_text(SECRET * 40)
    return path


def other_hdf5(folder: Path) -> Path:
    h5py = pytest.importorskip("h5py")
    path = folder / "other.hdf5"
    with h5py.File(path, "w") as file:
        file["y"] = T
    return path


def external(file: Any, target: Path) -> None:
    file.create_dataset("x", (100,), dtype="u1", external=[(str(target), 0, 100)])


def virtual(file: Any, target: Path) -> None:
    h5py = pytest.importorskip("h5py")
    layout = h5py.VirtualLayout((100,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(target), "y", shape=(100,))
    file.create_virtual_dataset("x", layout)


def linked(file: Any, target: Path) -> None:
    file["x"] = pytest.importorskip("h5py").ExternalLink(str(target), "y")


def linked_twice(file: Any, target: Path) -> None:
    h5py = pytest.importorskip("h5py")
    file.create_group("deep")["away"] = h5py.ExternalLink(str(target), "/")
    file["x"] = h5py.SoftLink("/deep/away/y")


@pytest.mark.parametrize("target", [secret, other_hdf5, fifo], ids=lambda one: one.__name__)
@pytest.mark.parametrize("fill", [external, virtual, linked, linked_twice], ids=lambda one: one.__name__)
@pytest.mark.parametrize("ending", [".h5", ".mat"])
def test_hdf5_that_reads_other_files(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    fill: Callable[[Any, Path], None],
    target: Callable[[Path], Path],
    ending: str,
) -> None:
    h5py, path = pytest.importorskip("h5py"), tmp_path / f"a{ending}"
    away = target(tmp_path / "pipe" if target is fifo else tmp_path)
    with h5py.File(path, "w") as file:
        file["t_s"], file["position_m"] = T, 0.01 * T
        fill(file, away)
    _, said = converted(path, capsys)
    assert OUTSIDE in said


def test_hdf5_with_links_in_itself_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    h5py, path = pytest.importorskip("h5py"), tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t_s"], file["position_m"], file["soft"] = T, 0.01 * T, h5py.SoftLink("/t_s")
        file.create_group("g")["round"] = file["/"]
    assert converted(path, capsys)[0] == 0


def test_hdf5_loads_no_filter_from_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    h5py, path = pytest.importorskip("h5py"), tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t_s"] = T
        how = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        how.set_chunk((100,))
        how.set_filter(32001, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((100,))
        one = h5py.h5d.create(file.id, b"x", h5py.h5t.IEEE_F64LE, space, how)
        one.write_direct_chunk((0,), T.tobytes(), 0)
    (tmp_path / "plugins").mkdir()
    fifo(tmp_path / "plugins" / "libfilter.so")  # whoever looks through the folder waits here
    monkeypatch.setenv("HDF5_PLUGIN_PATH", str(tmp_path / "plugins"))
    _, said = converted(path, capsys)
    assert "must be a whole MATLAB or HDF5 file" in said


@pytest.mark.parametrize("embedded", [True, False])
@pytest.mark.parametrize("frames", [False, True])
def test_mf4_with_an_attachment(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    embedded: bool,
    frames: bool,
) -> None:
    asammdf, path = pytest.importorskip("asammdf"), tmp_path / "a.mf4"
    monkeypatch.chdir(tmp_path)
    with asammdf.MDF(version="4.10") as file:
        names = ("a", "CAN_DataFrame.x" if frames else "b")
        file.append([asammdf.Signal(np.sin(T), T, name=name) for name in names])
        file.attach(SECRET.encode(), file_name="att.txt", embedded=embedded, mime="text/plain")
        file.save(path, overwrite=True)
    status, said = converted(path, capsys)
    if not embedded:
        assert f"{OUTSIDE} an attachment in the file att.txt" in said
    elif not frames:
        assert status == 0


def test_a_tdms_file_is_read_without_what_stands_beside_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nptdms, path = pytest.importorskip("nptdms"), tmp_path / "a.tdms"
    with nptdms.TdmsWriter(str(path)) as file:
        file.write_segment([nptdms.ChannelObject("g", name, np.sin(T)) for name in ("a", "b")])
    (tmp_path / "a.tdms_index").unlink(missing_ok=True)
    fifo(tmp_path / "a.tdms_index")
    assert converted(path, capsys)[0] == 0


def test_a_parquet_file_of_columns_that_are_elsewhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table, told = pyarrow.table({"t_s": T, "position_m": T}), list[Any]()
    parquet.write_table(table, tmp_path / "part.parquet", metadata_collector=told)
    told[0].set_file_path("part.parquet")
    parquet.write_metadata(table.schema, tmp_path / "a.parquet", metadata_collector=told)
    assert f"{OUTSIDE} the column t_s in the file part.parquet" in converted(tmp_path / "a.parquet", capsys)[1]


def test_an_mcap_file_with_an_attachment_is_read_without_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, path = pytest.importorskip("mcap.writer"), tmp_path / "a.mcap"
    monkeypatch.chdir(tmp_path)
    with path.open("wb") as file:
        one = writer.Writer(file)
        one.start()
        channel = one.register_channel("x", "json", one.register_schema("x", "jsonschema", b'{"type": "object"}'))
        for k in range(9):
            one.add_message(channel, k, b'{"a": 1, "b": 2}', k)
        one.add_attachment(0, 0, "../away.txt", "text/plain", SECRET.encode())
        one.finish()
    assert converted(path, capsys)[0] == 0
    assert sorted(found.name for found in tmp_path.iterdir()) == ["a.mcap", "out.parquet"]


def bag(path: Path) -> Path:
    """A bag of two topics; its database is `path/NAME.db3`."""
    writer, typesys = pytest.importorskip("rosbags.rosbag2"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    float64 = store.types["std_msgs/msg/Float64"]
    with writer.Writer(path, version=9) as file:
        for topic in ("/x", "/y"):
            connection = file.add_connection(topic, float64.__msgtype__, typestore=store)
            for k in range(50):
                data = store.serialize_cdr(float64(float(k)), float64.__msgtype__)
                file.write(connection, 10_000_000 * k, data)
    return path


def renamed(path: Path, name: str) -> None:
    """The bag's metadata name its database otherwise."""
    told = path / "metadata.yaml"
    told.write_text(told.read_text().replace(f"{path.name}.db3", name))


def no_change(path: Path) -> None:
    """A whole bag."""


def above(path: Path) -> None:
    bag(path.parent / "other")
    shutil.move(path.parent / "other" / "other.db3", path.parent / "other.db3")
    renamed(path, "../other.db3")


def absolute(path: Path) -> None:
    bag(path.parent / "other")
    renamed(path, str(path.parent / "other" / "other.db3"))


def as_address(path: Path) -> None:
    above(path)
    (path / f"{path.name}.db3").rename(path / "..%2fother.db3")
    renamed(path, "..%2fother.db3")
    told = path / "metadata.yaml"
    told.write_text(told.read_text().replace("../other.db3", "..%2fother.db3"))


def as_link(path: Path) -> None:
    above(path)
    renamed(path, f"{path.name}.db3")
    (path / f"{path.name}.db3").unlink()
    (path / f"{path.name}.db3").symlink_to(path.parent / "other.db3")


def as_pipe(path: Path) -> None:
    (path / f"{path.name}.db3").unlink()
    fifo(path / f"{path.name}.db3")


def computed(path: Path) -> None:
    with sqlite3.connect(path / f"{path.name}.db3") as tables:
        tables.execute("ALTER TABLE messages RENAME TO m")
        endless = "WITH RECURSIVE q(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM q)"
        tables.execute(f"CREATE VIEW messages AS {endless} SELECT m.* FROM m, q")
    tables.close()


def as_program(path: Path) -> None:
    mark = path.parent / "ran"
    (path / "metadata.yaml").write_text(f"!!python/object/apply:os.system ['touch {mark}']\n")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (no_change, ""),
        (above, "file must be a whole ROS bag file"),
        (absolute, "file must be a whole ROS bag file"),
        (as_address, "must be without %"),
        (as_link, OUTSIDE),
        (as_pipe, "must be a regular file"),
        (computed, "bag must hold plain tables; got messages"),
        (as_program, "file must be a whole ROS bag file"),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_ros_bags(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], change: Callable[[Path], None], sentence: str
) -> None:
    path = bag(tmp_path / "bag")
    change(path)
    status, said = converted(path, capsys)
    assert status == (2 if sentence else 0)
    assert sentence in said
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("ending", sorted({*ENDINGS, *(ending for one in FORMATS for ending in one.endings), *LOGS}))
@pytest.mark.parametrize("kind", [fifo, lambda path: path.symlink_to("/dev/zero")], ids=["pipe", "device"])
def test_no_pipe_and_no_device_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: Callable[[Path], object], ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    kind(path)
    assert "must be a regular file" in converted(path, capsys)[1]


def test_whole_files_are_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What the fence round a record leaves to its library."""
    channels = [Channel(Heading(name, "m", "g", clocked=True), np.sin(T), T) for name in ("a", "b")]
    for ending in (".mf4", ".mcap", ".parquet"):
        path = tmp_path / f"a{ending}"
        path.write_bytes(write_channels(path, channels))
        assert converted(path, capsys)[0] == 0
    scipy = pytest.importorskip("scipy.io")
    scipy.savemat(tmp_path / "a.mat", {"t_s": T, "s": {"x": T}}, do_compression=True)
    assert converted(tmp_path / "a.mat", capsys)[0] == 0
