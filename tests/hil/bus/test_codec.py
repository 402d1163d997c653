"""The fast codec says what cantools says, both ways, and refuses what cantools lets through."""

import binascii
import math
import re
from pathlib import Path
from typing import Any

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.bus.catalogue import COUNTER, CRC, DBC, Frame, load_catalogue
from hil.bus.codec import Codec, FrameError, Refusal
from tests.hil.bus.bus_load import bus_load, longest_bits
from tests.places import ROOT

CATALOGUE = load_catalogue()
PEER: Any = cantools.database.load_file(DBC)
frames = st.sampled_from(list(CATALOGUE.frames.values()))
PROTECTION = {CRC: 0, COUNTER: 0}


@st.composite
def filled(draw: st.DrawFn, raw: bool = False) -> tuple[Frame, dict[str, float]]:
    """A frame with values of all its signals: on the raw grid, or anywhere in range."""
    frame = draw(frames)
    values = {}
    for f in frame.fields:
        if raw or f.names:
            choices = st.sampled_from(sorted(f.names)) if f.names else st.integers(f.raw_lower, f.raw_upper)
            values[f.name] = draw(choices) * f.scale + f.offset
            values[f.name] = min(max(values[f.name], f.lower), f.upper)
        else:
            values[f.name] = draw(st.floats(f.lower, f.upper))
    return frame, values


@given(filled())
def test_encoding_is_cantools(case: tuple[Frame, dict[str, float]]) -> None:
    frame, values = case
    ours = Codec(frame).encode(values).to_bytes(frame.length, "little")
    theirs = PEER.get_message_by_name(frame.name).encode(values | PROTECTION)
    assert ours == theirs


@given(frames, st.binary(min_size=8, max_size=8))
def test_decoding_is_cantools_where_it_is_in_range(frame: Frame, data: bytes) -> None:
    theirs = PEER.get_message_by_name(frame.name).decode(data, decode_choices=False)
    ours = Codec(frame).decode(int.from_bytes(data, "little"))
    raws = {f.name: round((theirs[f.name] - f.offset) / f.scale) for f in frame.fields}
    good = all(
        f.raw_lower <= raws[f.name] <= f.raw_upper and (not f.names or raws[f.name] in f.names) for f in frame.fields
    )
    if good:
        assert ours == {f.name: theirs[f.name] for f in frame.fields}
    else:
        assert isinstance(ours, Refusal)
        assert ours.reason == "range"


@given(filled(raw=True))
def test_what_was_sent_is_read(case: tuple[Frame, dict[str, float]]) -> None:
    frame, values = case
    found = Codec(frame).decode(Codec(frame).encode(values))
    assert isinstance(found, dict)
    assert all(found[f.name] == pytest.approx(values[f.name], abs=1e-9 * f.scale) for f in frame.fields)


@given(filled())
def test_rounding_loses_half_a_step_at_most(case: tuple[Frame, dict[str, float]]) -> None:
    frame, values = case
    found = Codec(frame).decode(Codec(frame).encode(values))
    assert isinstance(found, dict)
    assert all(abs(found[f.name] - values[f.name]) <= f.scale * 0.5 * (1 + 1e-6) for f in frame.fields)


@given(filled(), st.data())
def test_what_does_not_fit_is_refused_before_it_is_sent(
    case: tuple[Frame, dict[str, float]], data: st.DataObject
) -> None:
    frame, values = case
    f = data.draw(st.sampled_from(frame.fields))
    above, below = math.nextafter(f.upper, math.inf), math.nextafter(f.lower, -math.inf)
    wrong: Any = data.draw(st.sampled_from([math.nan, math.inf, -math.inf, above, below, 1e300, None, "1", 1j]))
    with pytest.raises(FrameError, match=f"{frame.name} {f.name} must"):
        Codec(frame).encode(values | {f.name: wrong})


def test_signals_that_are_missing_or_unknown_are_refused() -> None:
    codec = Codec(CATALOGUE["CoilCommand"])
    with pytest.raises(FrameError, match="'Mode' is missing"):
        codec.encode({"Current_A": 0.1, "TimeToLive_ms": 8})
    with pytest.raises(FrameError, match="did you mean 'Current_A'"):
        codec.encode({"Curent_A": 0.1, "TimeToLive_ms": 8, "Mode": 2})
    with pytest.raises(FrameError, match="got 'Extra'"):
        codec.encode({"Current_A": 0.1, "TimeToLive_ms": 8, "Mode": 2, "Extra": 1})


def test_the_catalogue_says_what_the_bench_needs() -> None:
    for name in ("CarriageCommand", "CoilCommand", "InnerMassCommand"):
        frame = CATALOGUE[name]
        assert frame.cycle_s == 0.002
        assert frame.field("TimeToLive_ms").lower >= 1
        assert frame.field("Mode").number("quick_stop") == 3
    for frame in CATALOGUE.frames.values():
        assert frame.comment
        assert frame.sender
        assert frame.receivers
        assert all(f.comment for f in frame.fields)
        assert frame.data_id > 0
    assert all(signal.comment for message in PEER.messages for signal in message.signals)
    assert CATALOGUE.bit_rate == 1_000_000
    assert CATALOGUE["SafeStop"].id < min(frame.id for name, frame in CATALOGUE.frames.items() if name != "SafeStop")


def test_a_miss_names_the_nearest() -> None:
    with pytest.raises(ValueError, match="did you mean 'CoilCommand'"):
        CATALOGUE["CoilComand"]
    with pytest.raises(ValueError, match="did you mean 'Current_A'"):
        CATALOGUE["CoilCommand"].field("Current")
    with pytest.raises(ValueError, match="did you mean 'enable'"):
        CATALOGUE["CoilCommand"].field("Mode").number("enabled")


@pytest.mark.parametrize(
    ("pattern", "new", "words"),
    [
        (r"\b(BO_|SG_|VAL_) 16 ", r"\1 2147483664 ", "11-bit identifier"),
        ('"DataId" BO_ 256 16', '"DataId" BO_ 256 17', "frame's own; got 17"),
        ('"DataId" BO_ 256 16', '"DataId" BO_ 256 0', "DataId from 1 to 255"),
        (r"SG_ Counter : 8\|4@1\+", "SG_ Counter : 8|3@1+", "4 bits at bit 8"),
        (r"\[-2.5\|2.5\]", "[-25|25]", "must fit its 18 bits"),
        (r"Mode : 38\|2@1\+", "Mode : 41|2@0+", "little-endian"),
        ('BA_ "Baudrate" 1000000;', 'BA_ "Baudrate" 5;', "Baudrate"),
        ("BO_ 16", "BOO 16", "cantools"),
        ('"GenMsgCycleTime" BO_ 256 2', '"GenMsgCycleTime" BO_ 256 0', "must have a cycle time"),
    ],
)
def test_a_catalogue_that_cannot_protect_is_refused(tmp_path: Path, pattern: str, new: str, words: str) -> None:
    changed, count = re.subn(pattern, new, DBC.read_text(encoding="utf-8"))
    assert count
    path = tmp_path / "other.dbc"
    path.write_text(changed, encoding="utf-8")
    with pytest.raises(ValueError, match=words):
        load_catalogue(path)


def changed(tmp_path: Path, old: str, new: str) -> Path:
    text = DBC.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "changed.dbc"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


def test_a_range_that_ends_between_two_steps_is_kept_on_the_wire(tmp_path: Path) -> None:
    codec = Codec(load_catalogue(changed(tmp_path, "[-2.5|2.5]", "[-2.499995|2.499995]"))["CoilCommand"])
    for value in (2.499995, -2.499995):
        found = codec.decode(codec.encode({"Current_A": value, "TimeToLive_ms": 8, "Mode": 2}))
        assert isinstance(found, dict)
        assert abs(found["Current_A"]) <= 2.499995


def test_a_number_that_stands_for_nothing_is_refused(tmp_path: Path) -> None:
    frame = load_catalogue(changed(tmp_path, 'VAL_ 272 Mode 0 "off" 1 "ready" ', 'VAL_ 272 Mode 0 "off" '))[
        "CoilCommand"
    ]
    values = {"Current_A": 0.0, "TimeToLive_ms": 8, "Mode": 2}
    assert isinstance(Codec(frame).decode(Codec(frame).encode(values)), dict)
    assert isinstance(Codec(frame).decode(Codec(frame).encode(values | {"Mode": 1})), Refusal)


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="can be read"):
        load_catalogue(tmp_path / "none.dbc")
    (tmp_path / "bad.dbc").write_bytes(b"\xff\xfe")
    with pytest.raises(ValueError, match="UTF-8"):
        load_catalogue(tmp_path / "bad.dbc")


def test_another_file_has_another_fingerprint(tmp_path: Path) -> None:
    path = tmp_path / "other.dbc"
    path.write_text(
        DBC.read_text(encoding="utf-8").replace("2e-05,0) [-2.5|2.5]", "2e-05,0) [-2.4|2.4]"), encoding="utf-8"
    )
    assert load_catalogue(path).fingerprint != CATALOGUE.fingerprint


def test_the_same_meaning_has_the_same_fingerprint(tmp_path: Path) -> None:
    """Line ends, comments, units and the order of the file are nobody's business; docs/bus.md states the number."""
    text = DBC.read_text(encoding="utf-8")
    first, last = text.index("BO_ 16 SafeStop"), text.index("BO_ 32 CarriageFault")
    moved = text[:first] + text[last:].replace('CM_ "Frames', text[first:last] + 'CM_ "Frames', 1)
    for k, other in enumerate((text.replace("\n", "\r\n"), text.replace("Where the capsule is", "Another"), moved)):
        path = tmp_path / f"{k}.dbc"
        path.write_bytes(other.encode())
        assert load_catalogue(path).fingerprint == CATALOGUE.fingerprint
    assert f"0x{CATALOGUE.fingerprint:04X}" in (ROOT / "docs" / "bus.md").read_text(encoding="utf-8")
    assert binascii.crc_hqx(b"123456789", 0xFFFF) == 0x29B1


def test_the_longest_frame_is_135_bits() -> None:
    assert longest_bits(8) == 135
    assert longest_bits(0) == 55


def test_the_catalogue_fits_the_bus_with_margin() -> None:
    everything = bus_load(CATALOGUE)
    assert sum(share.load for share in everything) == pytest.approx(0.649, abs=1e-3)
    nodes = {"Controller", "Carriage", "Localiser", "ForceSensor"}
    others = {"CoilCommand", "InnerMassCommand"}
    assert sum(s.load for s in bus_load(CATALOGUE, nodes) if s.name not in others) == pytest.approx(0.345, abs=1e-3)
    delays = {share.name: share.delay_s for share in everything}
    assert max(delays[name] for name in delays if name.endswith("Command")) <= 1.351e-3
    assert all(delays[name] <= 2.03e-3 for name, frame in CATALOGUE.frames.items() if frame.cycle_s == 0.002)


def test_a_bus_that_is_too_full_has_no_bounded_delay() -> None:
    slow = type(CATALOGUE)(CATALOGUE.frames, 500_000, 0, "slow")
    shares = bus_load(slow)
    assert sum(share.load for share in shares) > 1
    assert shares[0].delay_s < 0.001
    assert math.isinf(shares[-1].delay_s)
