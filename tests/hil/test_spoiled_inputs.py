"""Every reader on spoiled files: content or one sentence, within bounds of time and memory; never a traceback."""

import gzip
import os
import random
import resource
import struct
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from importlib import reload
from pathlib import Path

import can
import can.io.mf4
import numpy as np
import pytest

from hil.app.campaign.file import load_campaign
from hil.app.main import run
from hil.app.scenario.bus_scenario import load_sil_scenario
from hil.app.scenario.deployment import load_deployment
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.scenario.scenario import load_track_scenario
from hil.formats.channels import Channel, Heading
from hil.formats.reading import write_channels
from hil.log.blf_file import SENT, BlfFile, Logged
from hil.log.reader import read_frames
from hil.log.record import file_channels
from hil.log.rig_record import read_rig_record
from models.checks.sizes import check_units
from models.checks.view import View
from models.identification.model import Model, read_model, read_report
from models.records.record import Record
from models.rigs.reader import read_rig
from models.theta import Theta
from plant.experiments.scenario import load_scenario
from tests.hil.app.track.track_texts import SHORT
from tests.rig_texts import GUT

LONGEST_S = 10.0
MOST_KB = 1 << 20
ASKING = """
import contextlib, resource, sys
from importlib import reload
from pathlib import Path
from hil.log.record import file_channels
with contextlib.suppress(ValueError):
    file_channels(Path(sys.argv[1]))
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
"""A small process of its own that reads a file and tells the most memory in kB of its reader: a child of this one
begins with what this one has.
"""
PULL = '[rig]\nkind = "pull"\n' + GUT
SCENARIO = (
    '[scenario]\nduration_s = 1.0\n[rig]\nkind = "pull"\n'
    '[profile]\nkind = "sine"\nfrequency_Hz = 1.0\namplitude_m = 0.01\n'
)
CAMPAIGN = (
    '[campaign]\nscenario = "short.toml"\ncases = 2\n[draw."tissue.friction_coefficient"]\nuniform = [0.06, 0.11]\n'
)
RECORD = "t_s,position_m,force_N\n" + "".join(f"{0.01 * k:.2f},{0.001 * k:.4f},{0.1:.3f}\n" for k in range(200))
DEPLOYMENT = Path(__file__).parents[2] / "examples" / "deployment" / "deployment.toml"
NUMBERS = ("1" * 400, "1" * 5000, "-1", "1e300", "1e-308", "nan", "inf", "true", '"x"', "[0, 0]", "{}", "0")


def model_text() -> str:
    stages = {stage: Theta({"friction_coefficient": 0.08}) for stage in ("nominal", "calibrated", "augmented")}
    return Model("pull", stages).to_toml()


READERS: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "rig": ("rig.toml", read_deployed_rig, PULL),
    "scenario": ("scenario.toml", load_scenario, SCENARIO),
    "track": ("track.toml", load_track_scenario, SHORT),
    "sil": ("sil.toml", load_sil_scenario, SHORT),
    "deployment": ("deployment.toml", load_deployment, DEPLOYMENT.read_text(encoding="utf-8")),
    "campaign": ("campaign.toml", load_campaign, CAMPAIGN),
    "model": ("model.toml", lambda path: read_model(path, "pull"), model_text()),
    "report": ("report.json", read_report, '{"verdict": "none", "error": {"train": {"nominal": 1.0}}}'),
    "record": ("record.csv", file_channels, RECORD),
}


def bounded(read: Callable[[Path], object], path: Path) -> str:
    """What `read` refuses `path` with, within bounds; empty where it is taken."""
    began, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    said = ""
    try:
        read(path)
    except ValueError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 2000
    assert time.process_time() - began < LONGEST_S
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_KB
    return said


def spoiled(data: bytes, rng: random.Random) -> bytes:
    """`data` with a few bytes changed, or a piece lost, repeated or moved."""
    out = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at, length = rng.randrange(len(out) + 1), rng.randint(1, 16)
        match rng.randrange(5):
            case 0:
                out[at : at + 1] = bytes([rng.randrange(256)])
            case 1:
                del out[at : at + length]
            case 2:
                out[at:at] = out[at : at + length] * rng.randint(1, 8)
            case 3:
                out[at : at + 4] = rng.choice((b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x01\0\0\0"))
            case _:
                del out[at:]
        if not out:
            break
    return bytes(out)


def spoiled_text(text: str, rng: random.Random) -> str:
    """`text` with a value put in another's place, or a line lost, repeated or moved."""
    lines = text.splitlines()
    k = rng.randrange(len(lines))
    key = lines[k].split("=")[0]
    match rng.randrange(4):
        case 0 | 1 if "=" in lines[k]:
            lines[k] = f"{key}= {rng.choice(NUMBERS)}"
        case 2:
            del lines[k]
        case _:
            lines.insert(rng.randrange(len(lines)), lines[k])
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("name", READERS)
def test_spoiled_files_are_content_or_one_sentence(tmp_path: Path, name: str) -> None:
    file, read, text = READERS[name]
    path, rng = tmp_path / file, random.Random(name)
    (tmp_path / "short.toml").write_text(SHORT)
    path.write_text(text, encoding="utf-8")
    bounded(read, path)
    few = name in ("track", "sil", "deployment", "campaign")
    for k in range(15 if few else 60):
        content = spoiled_text(text, rng).encode() if k % 3 else spoiled(text.encode(), rng)
        path.write_bytes(content)
        bounded(read, path)


@pytest.mark.parametrize("name", READERS)
def test_nothing_but_regular_files_of_text_is_read(tmp_path: Path, name: str) -> None:
    file, read, text = READERS[name]
    path = tmp_path / file
    os.mkfifo(path)
    assert "must be a regular file" in bounded(read, path)
    for device in ("/dev/zero", "/dev/urandom"):
        path.unlink()
        path.symlink_to(device)
        assert "must be a regular file" in bounded(read, path)
    path.unlink()
    path.write_bytes(text.encode("utf-32"))
    said = bounded(read, path)
    assert not said if name == "record" else "UTF-32" in said  # instruments write what they like, people UTF-8


@pytest.mark.parametrize("digits", [400, 5000])
@pytest.mark.parametrize("name", ["rig", "scenario", "track", "campaign", "model"])
def test_numbers_of_many_digits_are_refused(tmp_path: Path, name: str, digits: int) -> None:
    file, read, text = READERS[name]
    (tmp_path / "short.toml").write_text(SHORT)
    for line in [line for line in text.splitlines() if "=" in line and line.split("=")[1].strip()[0].isdigit()]:
        key = line.split("=")[0]
        (tmp_path / file).write_text(text.replace(line, f"{key}= {'1' * digits}", 1))
        assert bounded(read, tmp_path / file), line


def log(path: Path) -> bytes:
    file = BlfFile(path)
    for k in range(300):
        file.write(Logged(1_000_000 * k, k % 0x7FF, k.to_bytes(8, "little"), SENT))
    file.stop()
    return path.read_bytes()


def repacked(data: bytes, change: Callable[[bytearray], None]) -> bytes:
    """A log of one container with what is in it changed."""
    at = data.index(b"LOBJ")
    size = struct.unpack_from("<L", data, at + 8)[0]
    content = bytearray(zlib.decompress(data[at + 32 : at + size]))
    change(content)
    packed = zlib.compress(bytes(content))
    head = bytearray(data[at : at + 32])
    struct.pack_into("<L", head, 8, 32 + len(packed))
    return data[:at] + bytes(head) + packed


@pytest.mark.parametrize(
    ("form", "place", "value", "sentence"),
    [
        ("<L", 8, 0, "byte 0 of what it unpacks to; got one of 0"),
        ("<L", 48 * 2 + 8, 3, "byte 96 of what it unpacks to; got one of 3"),
        ("<H", 6, 7, "header of version 1 or 2 at byte 144, byte 0 of what it unpacks to; got version 7"),
        ("<4s", 48, b"XXXX", "byte 48 of what it unpacks to; got another content"),
    ],
)
def test_a_log_with_an_impossible_object_is_told_with_its_place(
    tmp_path: Path, form: str, place: int, value: object, sentence: str
) -> None:
    path = tmp_path / "a.blf"
    data = log(path)
    path.write_bytes(repacked(data, lambda content: struct.pack_into(form, content, place, value)))
    assert sentence in bounded(lambda p: list(read_frames(p)), path)


def test_a_log_that_is_cut_off_is_told(tmp_path: Path) -> None:
    path, told = tmp_path / "a.blf", list[str]()
    data = log(path)
    assert len(list(read_frames(path, told.append))) == 300
    assert not told
    path.write_bytes(data[:-20])
    list(read_frames(path, told.append))
    assert len(told) == 1
    assert f"cut off at byte {len(data) - 20}" in told[0]


@pytest.mark.parametrize("ending", [".blf", ".asc", ".trc", ".log"])
def test_spoiled_logs(tmp_path: Path, ending: str) -> None:
    path, rng = tmp_path / f"a{ending}", random.Random(ending)
    texts = {
        ".asc": "date Sat Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n"
        + "".join(f"  {0.01 * k:.4f} 1  123  Rx  d 8 01 02 03 04 05 06 07 08\n" for k in range(50)),
        ".trc": ";$FILEVERSION=1.1\n" + "".join(f" {k:5d})  {k:8.1f}  Rx  0123  2  01 02\n" for k in range(1, 50)),
        ".log": "".join(f"(1500000000.{k:06d}) can0 123#0102030405060708\n" for k in range(50)),
    }
    data = log(path) if ending == ".blf" else texts[ending].encode()
    for _ in range(40):
        path.write_bytes(spoiled(data, rng))
        bounded(lambda p: list(read_frames(p)), path)
    if ending == ".blf":
        for _ in range(40):
            path.write_bytes(repacked(data, lambda content: _spoil_within(content, rng)))
            bounded(lambda p: list(read_frames(p)), path)


def test_spoiled_mf4_logs(tmp_path: Path) -> None:
    pytest.importorskip("asammdf")
    path, rng = tmp_path / "a.mf4", random.Random("log")
    writer = reload(can.io.mf4).MF4Writer(path)  # it has no asammdf where a command loads python-can
    for k in range(50):
        writer.on_message_received(can.Message(1.5e9 + 0.01 * k, 0x123, False, data=bytes([k] * 8), channel=0))
    writer.stop()
    frames = list(read_frames(path))
    assert [(frame.id, frame.data[0]) for frame in frames] == [(0x123, k) for k in range(50)]
    data = path.read_bytes()
    for _ in range(2):
        path.write_bytes(spoiled(data, rng))
        bounded(lambda p: list(read_frames(p)), path)


def _spoil_within(content: bytearray, rng: random.Random) -> None:
    content[:] = spoiled(bytes(content), rng)


@pytest.mark.parametrize("ending", [".mf4", ".mcap"])
def test_spoiled_files_of_channels(tmp_path: Path, ending: str) -> None:
    t = 0.01 * np.arange(200)
    channels = [Channel(Heading(name, "m", "g", clocked=True), np.sin(t), t) for name in ("a", "b")]
    path, rng = tmp_path / f"a{ending}", random.Random(ending)
    data = write_channels(path, channels)
    for _ in range(2):
        path.write_bytes(spoiled(data, rng))
        bounded(file_channels, path)


def test_a_packed_message_of_a_gigabyte_ends_within_bounds(tmp_path: Path) -> None:
    """A small file whose messages are mostly blanks: one sentence, and the reader takes no more than its share."""
    writer = pytest.importorskip("mcap.writer")
    path = tmp_path / "bomb.mcap"
    with path.open("wb") as file:
        log_file = writer.Writer(file, chunk_size=1 << 31)
        log_file.start()
        schema = log_file.register_schema("x", "jsonschema", b'{"type": "object"}')
        channel = log_file.register_channel("x", "json", schema)
        for k in range(12):
            log_file.add_message(channel, k, b'{"a": 1}' + b" " * (50 << 20), k)
        log_file.finish()
    said = bounded(file_channels, path)
    assert said.startswith(f"{path}: ")
    asked = subprocess.run([sys.executable, "-c", ASKING, str(path)], capture_output=True, text=True, check=True)
    assert int(asked.stdout) < MOST_KB


def test_packed_nothing_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.csv.gz"
    with gzip.open(path, "wb") as file:
        file.write(RECORD.encode())
        for _ in range(2):
            file.write(b"\n" * (1 << 20))
    (tmp_path / "rig.toml").write_text(PULL)
    rig = read_rig(tmp_path / "rig.toml")
    assert "empty lines" in bounded(lambda p: read_rig_record(p, rig), path)


@pytest.mark.parametrize(
    ("name", "old", "new", "sentence"),
    [
        ("rig", "contact_angle_deg = 60.0", "contact_angle_deg = 1e-308", "contact_angle_deg must be 1 to 89 deg"),
        ("rig", "mass_kg = 4.0e-3", "mass_kg = 4.0", "mass_kg must be 1e-05 to 0.5 kg"),
        (
            "rig",
            "[rig]",
            "[noise]\nposition_std_m = 10.0\n[rig]",
            "position_std_m must be 1e-09 to 0.1 m",
        ),
        ("scenario", "duration_s = 1.0", "duration_s = -1.0", "duration_s must be"),
        ("scenario", "duration_s = 1.0", "duration_s = -1.0\nstep_s = -1e-5", "step_s must be"),
        ("scenario", "duration_s = 1.0", "duration_s = 1e-9", "duration_s must be"),
        ("scenario", "[profile]", "[noise]\nforce_std_N = 1e300\n[profile]", "force_std_N must be"),
        ("scenario", "[profile]", "[tissue]\ncontact_angle_deg = 1e-308\n[profile]", "contact_angle_deg must be"),
        ("track", "[reference]", "[localisation]\nstd = 1e300\n[reference]", "localisation.std must lie in"),
        ("track", "[reference]", "[capsule]\nmass_kg = 4.0\n[reference]", "capsule.mass_kg must be"),
    ],
)
def test_absurd_numbers_are_refused(tmp_path: Path, name: str, old: str, new: str, sentence: str) -> None:
    file, read, text = READERS[name]
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new, 1))
    assert sentence in bounded(read, tmp_path / file)


def test_missing_keys_are_told_all_at_once(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text('[rig]\nkind = "pull"\n[capsule]\n[tissue]\n')
    with pytest.raises(ValueError, match=r"'radius_m'.*'cylinder_length_m'.*'mass_kg'.*such as 4.0e-3") as caught:
        read_rig(path)
    (pasted,) = caught.value.__notes__
    assert "mass_kg = 4.0e-3" in pasted


@pytest.mark.parametrize(
    ("time_by", "place_by", "found"), [(1, 1, ""), (1, 1000, "units"), (1, 1e-9, "units"), (1000, 1, "time_units")]
)
def test_another_unit_is_a_finding(tmp_path: Path, time_by: float, place_by: float, found: str) -> None:
    (tmp_path / "rig.toml").write_text(PULL)
    t = 0.01 * np.arange(2000)
    x, f = 0.005 * np.sin(t), 0.1 + 0.01 * np.cos(t) + 1e-3 * np.random.default_rng(0).standard_normal(2000)
    columns = {"t_s": time_by * t, "position_m": place_by * x, "force_N": f}
    ids = {one.id for one in check_units(View(Record("r", "pull", columns), read_rig(tmp_path / "rig.toml")))}
    assert ids == ({found} if found else set())


@pytest.mark.parametrize(
    ("name", "old", "new", "sentence"),
    [
        ("rig", "recovery_time_s = 0.05", "recovery_time_s = 1e-308", "recovery_time_s must be 0.0001 to 100 s"),
        (
            "rig",
            "[rig]",
            "[noise]\nforce_std_N = 1e-308\n[rig]",
            "force_std_N must be 1e-09 to 100 N",
        ),
        (
            "scenario",
            "[profile]",
            "[effects.fold_periodic]\nwavelength_m = -1.0\n[profile]",
            "wavelength_m must be positive",
        ),
        ("scenario", "[profile]", "[effects.fold_periodic]\nexcess = 1e300\n[profile]", "excess must be at most 350"),
        ("scenario", "[profile]", "[tissue]\nhoop_stress_factor = 1e300\n[profile]", "hoop_stress_factor must be"),
        ("track", 'kind = "magnetic"', 'kind = "magnetic"\nmagnet_stiffness_N_per_m = 1e300', "must be at least 1e-12"),
        ("track", 'kind = "magnetic"', 'kind = "magnetic"\nmagnet_range_m = 1e-308', "magnet_range_m must be 1e-06"),
        ("track", "[reference]", "[limits]\nforce_N = 1e300\n[reference]", "force_N must be a number from 1e-06 to 20"),
        (
            "track",
            'kind = "magnetic"',
            'kind = "coil"\n[drive]\nresistance_ohm = 1e300',
            "drive.resistance_ohm must be 0 or 1e-12 to",
        ),
        (
            "track",
            'kind = "magnetic"',
            'kind = "magnetic"\n[rig.magnet]\nheight_m = 1e-308\nouter_moment_A_m2 = 1.0\ninner_moment_A_m2 = 1.0',
            "height_m must be 0.001 to 10 m",
        ),
        ("deployment", "temperature_C = 43.0", "temperature_C = 1e300", "temperature_C must be a number from"),
        ("deployment", "answer_s = 60.0", "answer_s = 1e300", "answer_s must be 0 or"),
    ],
)
def test_numbers_that_no_unit_can_have_are_refused(
    tmp_path: Path, name: str, old: str, new: str, sentence: str
) -> None:
    """Far too small and far too large ones, in the belief, the truth, the limits and what runs beside them."""
    file, read, text = READERS[name]
    assert old in text
    path = tmp_path / file
    path.write_text(text.replace(old, new, 1))
    said = bounded(read, path)
    assert sentence in said
    assert said.startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("t_by", "force_by", "sentence"),
    [
        (1e-300, 1, "t_s must step by 1 µs to 1 s"),
        (1e300, 1, "t_s must step by 1 µs to 1 s"),
        (1e3, 1, "t_s must step by 1 µs to 1 s"),
        (1, 1e300, "force_N must be between -1000 and 1000 N"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_samples_of_no_rig_stop_at_the_first_look(
    tmp_path: Path, t_by: float, force_by: float, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    t = 0.01 * np.arange(1000)
    rows = zip(t_by * t, 0.005 * np.sin(t), force_by * (0.1 + 0.01 * np.cos(t)), strict=True)
    (tmp_path / "r.csv").write_text(RECORD.splitlines()[0] + "\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows))
    (tmp_path / "rig.toml").write_text(PULL)
    words = [str(tmp_path / "r.csv"), "--rig", str(tmp_path / "rig.toml")]
    status = run(["check", *words])
    said = capsys.readouterr()
    assert sentence in " ".join((said.out if status == 1 else said.err).split())
    assert status == (1 if force_by == 1 else 2)
    assert run(["close-loop", *words, "--out", str(tmp_path / "o")]) == 2
    assert sentence in capsys.readouterr().err


def test_a_link_to_itself_and_an_empty_name_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loop = tmp_path / "loop.csv"
    loop.symlink_to(loop)
    (tmp_path / "rig.toml").write_text(PULL)
    for words, sentence in (
        (["check", str(loop), "--rig", str(tmp_path / "rig.toml")], "loop.csv: record must be a file"),
        (["campaign", ""], "what follows 'campaign' must name a file or a folder"),
        (["init", "pull", ""], "what follows 'pull' must name a file or a folder"),
        (["check", str(loop), "--rig", ""], "--rig must name a file or a folder"),
        (["demo", "--seed", "9" * 400], "--seed must be less than or equal to"),
        (["demo", "--seed", "x"], "--seed must be a valid integer; got 'x'"),
    ):
        assert run(words) == 2, words
        assert sentence in capsys.readouterr().err
