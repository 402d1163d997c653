"""Records: what is read, and one sentence with file, line and column for everything that is wrong."""

import gzip
import re
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from models.files import csv_reader as csv_blocks
from models.records.record import USED, Record, as_measured, read_record, record_of
from models.rigs.kinds import KINDS
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from tests.rig_texts import GUT

HEADER = "t_s,position_m,force_N\n"
ROWS = "".join(f"{0.01 * i:.2f},{1e-4 * i:.4f},{0.05 + 1e-4 * (i % 7):.4f}\n" for i in range(200))


def read(folder: Path, content: str | bytes, kind: str = "pull", name: str = "r.csv", **options: bool) -> Record:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_record(path, Rig(kind), **options)


def test_reads_a_time_series(tmp_path: Path) -> None:
    record = read(tmp_path, HEADER + ROWS)
    assert (record.name, record.kind, len(record)) == ("r", "pull", 200)
    np.testing.assert_allclose(record["t_s"], 0.01 * np.arange(200), atol=1e-12)


@pytest.mark.parametrize(
    "content",
    [
        (HEADER + ROWS).replace(",", ";"),
        (HEADER + ROWS).replace(",", ";").replace(".", ","),
        "\ufeff" + HEADER + ROWS,
        (HEADER + ROWS).replace("\n", "\r\n"),
        (HEADER + ROWS).replace("\n", "\r"),
        (HEADER + ROWS).replace(",", "\t"),
        (HEADER + ROWS).replace("\n", "\n\n"),
        (HEADER + ROWS).replace(",", " , "),
        '"t_s","position_m","force_N"\n' + ROWS,
        (HEADER + ROWS).rstrip("\n"),
    ],
    ids=[
        "semicolon",
        "decimal comma",
        "byte-order mark",
        "crlf",
        "cr",
        "tab",
        "blank lines",
        "spaces",
        "quotes",
        "no last newline",
    ],
)
def test_spellings_of_the_same_record(tmp_path: Path, content: str) -> None:
    plain, other = read(tmp_path, HEADER + ROWS), read(tmp_path, content)
    assert list(other.columns) == list(plain.columns)
    for name, column in plain.columns.items():
        np.testing.assert_array_equal(other[name], column)


SPACED = ROWS.replace(",", "  ")


@pytest.mark.parametrize(
    ("content", "name"),
    [
        ("t_s   position_m  force_N\n" + SPACED, "r.txt"),
        ("# t_s position_m force_N\n" + SPACED, "r.dat"),
        ("# force_N by cell 3\n# a rig\n t_s position_m force_N \ns m N\n " + SPACED.replace("\n", " \n "), "r.txt"),
        ("t_s position_m force_N\n" + SPACED.replace(".", ","), "r.txt"),
    ],
)
def test_columns_apart_by_spaces(tmp_path: Path, content: str, name: str) -> None:
    plain, other = read(tmp_path, HEADER + ROWS), read(tmp_path, content, name=name)
    for column, values in plain.columns.items():
        np.testing.assert_array_equal(other[column], values)


@pytest.mark.parametrize(
    "stamp",
    [
        lambda t: f"2026-03-01T23:59:{58 + t:06.3f}Z" if t < 2 else f"2026-03-02T00:00:{t - 2:06.3f}Z",
        lambda t: f"2026-03-01 12:30:{t:06.3f}",
        lambda t: f"23:59:{58 + t:06.3f}" if t < 2 else f"0:00:{t - 2:06.3f}",
        lambda t: f"01/03/2026 11:59:{58 + t:06.3f} AM" if t < 2 else f"01/03/2026 12:00:{t - 2:06.3f} PM",
        lambda t: f"{59:02d}:{58 + t:06.3f}" if t < 2 else f"{60:02d}:{t - 2:06.3f}",
    ],
)
def test_stamps_as_dates_and_times_of_day(tmp_path: Path, stamp: Callable[[float], str]) -> None:
    plain = read(tmp_path, HEADER + ROWS)
    t = 0.02 * np.arange(len(plain))
    rows = "".join(f"{stamp(at)},{x},{f}\n" for at, x, f in zip(t, plain["position_m"], plain["force_N"], strict=True))
    np.testing.assert_allclose(np.diff(read(tmp_path, HEADER + rows)["t_s"]), 0.02, atol=1e-6)


def test_a_stamp_that_is_none_is_refused_with_its_line(tmp_path: Path) -> None:
    rows = "".join(f"12:30:{0.02 * k:06.3f},{k}e-6,0.05\n" for k in range(200)).replace("12:30:00.400", "yesterday")
    with pytest.raises(ValueError, match="line 22: t_s must be a finite number; got 'yesterday'"):
        read(tmp_path, HEADER + rows)
    with pytest.raises(ValueError, match=r"line 2: position_m must be a finite number; got '12:30:00\.000'"):
        read(tmp_path, "position_m,t_s,force_N\n" + rows.replace("yesterday", "12:30:00.400"))


def test_gzip(tmp_path: Path) -> None:
    assert len(read(tmp_path, gzip.compress((HEADER + ROWS).encode()), name="r.csv.gz")) == 200


def test_further_columns_are_kept_where_they_hold_numbers(tmp_path: Path) -> None:
    rows = ROWS.replace("\n", ",,ok,3\n").replace(",,ok", ",36.5,ok", 1)
    record = read(tmp_path, "t_s,position_m,force_N,temperature_C,note,gain\n" + rows)
    assert list(record.columns) == ["t_s", "position_m", "force_N", "temperature_C", "gain"]
    assert record["temperature_C"][0] == 36.5
    assert np.isnan(record["temperature_C"][1:]).all()


MAGNETIC = "t_s,carriage_position_m,position_m\n"
SPARSE = "".join(f"{0.01 * i:.2f},{1e-4 * i:.4f},{f'{9e-5 * i:.6f}' if i % 4 == 1 else ''}\n" for i in range(800))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_measured_column_may_be_empty_where_nothing_was_measured(tmp_path: Path, separator: str) -> None:
    record = read(tmp_path, (MAGNETIC + SPARSE).replace(",", separator), "magnetic")
    there = np.arange(800) % 4 == 1
    np.testing.assert_array_equal(record[USED], there)
    np.testing.assert_allclose(record["position_m"][there], 9e-5 * np.arange(800)[there], atol=1e-9)
    assert np.isfinite(record["position_m"]).all()
    again = record_of("again", as_measured(record), Rig("magnetic"))
    np.testing.assert_array_equal(again["position_m"], record["position_m"])
    np.testing.assert_array_equal(again[USED], there)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (SPARSE.replace("0.000090", "lost"), "line 3: position_m must be a finite number; got 'lost'"),
        ("".join(SPARSE.splitlines(True)[:270]), "position_m must hold a number in at least 100 rows; got 68 in 270"),
    ],
)
def test_only_a_cell_of_none_is_none(tmp_path: Path, content: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        read(tmp_path, MAGNETIC + content, "magnetic")


@pytest.mark.parametrize("none", ["", "NaN", "null"])
def test_rows_without_a_stamp_or_a_driven_value_are_told(tmp_path: Path, none: str) -> None:
    whole = read(tmp_path, HEADER + ROWS)
    for cell, why in (("\n0.50,", "stamps_astray"), ("0.0050,", "no_number")):
        spoilt = ROWS.replace(cell, cell.replace(cell.strip("\n,"), none))
        record = read(tmp_path, HEADER + spoilt)
        assert [(one.why, one.where[:7]) for one in record.left_out] == [(why, "line 52")]
        assert record["position_m"] == pytest.approx(
            np.interp(record["t_s"], whole["t_s"], whole["position_m"]), abs=1e-9
        )
    with pytest.raises(ValueError, match="line 2: t_s must be a finite number; got none in 20 of 200 rows"):
        read(tmp_path, HEADER + re.sub(r"(?m)^\d\.\d0,", none + ",", ROWS))


def test_a_table_of_columns_with_clocks_of_their_own_is_read_as_such(tmp_path: Path) -> None:
    t = 0.005 * np.arange(2000)
    away = (t > 4) & (t < 6)
    rows = [
        f"{at:.3f}," + (f"{s:.6f},\n" if k % 2 else f",{c:.6f}\n")
        for k, (at, s, c) in enumerate(zip(t, np.sin(t), np.cos(t), strict=True))
    ]
    kept = [row for row, gone in zip(rows, away, strict=True) if not gone or row.endswith(",\n") is False]
    record = read(tmp_path, "t_s,carriage_position_m,position_m\n" + "".join(kept), "magnetic")
    assert len(record) == pytest.approx(800, abs=3)
    assert record["carriage_position_m"] == pytest.approx(np.sin(record["t_s"]), abs=2e-5)
    assert record["position_m"] == pytest.approx(np.cos(record["t_s"]), abs=2e-6)
    assert "carriage_position_m has no samples there" in " ".join(record.said)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "empty file"),
        ("\n \n", "empty file"),
        (HEADER, "at least 100 rows; got 0"),
        (HEADER + ROWS[:300], r"line \d+: row must have 3 values|at least 100 rows"),
        (
            ROWS,
            "header must have the column t_s, position_m, force_N .kind pull.; got 'column 1', 'column 2', 'column 3'",
        ),
        (HEADER.replace("force_N", "force_mN") + ROWS, "'force_N', in N; got 'force_mN'"),
        (HEADER.replace("position_m", "position_mm") + ROWS, "'position_m', in m; got 'position_mm'"),
        (HEADER.replace("t_s", "t_ms") + ROWS, "'t_s', in s; got 't_ms'"),
        (HEADER.replace("force_N", "Force_N") + ROWS, "'force_N', in N; got 'Force_N'"),
        (HEADER.replace("force_N", "forse_N") + ROWS, "column force_N.*'forse_N', did you mean 'force_N'"),
        (HEADER.replace("force_N", "t_s") + ROWS, "'t_s' twice"),
        ("t_s,carriage_position_m,position_m\n" + ROWS, "columns of kind magnetic"),
        ("period_s,valley_N,peak_N\n" + ROWS, "columns of kind periods"),
        (HEADER + ROWS.replace("\n1.5", "\n1.2"), "line 152: t_s must increase; got 1.2 after 1.49"),
        (HEADER + re.sub(r"\n1\.5\d", "\n1.49", ROWS), "line 152: t_s must increase"),
        (HEADER + ROWS.replace("0.0015,", "abc,"), "line 17: position_m must be a finite number; got 'abc'"),
        (HEADER + ROWS.replace("0.0015,", "inf,"), "line 17: position_m must be a finite number; got 'inf'"),
        (HEADER + ROWS.replace("0.0015,", ""), "line 17: row must have 3 values as the header has; got 2"),
        (
            HEADER + "".join(",".join(["1.0"] * 300) + "\n" for _ in range(3)),
            "line 2: row must have 3 values as the header has; got 300",
        ),
        ("\n" + HEADER + "\n" + ROWS.replace("0.0015,", "x,"), "line 19: position_m"),
        (b"\0" * 3_000_000, "line 1: line must be shorter"),
        (gzip.compress((HEADER + ROWS).encode())[:-40], "truncated or damaged"),
        (b"\x1f\x8bgarbage", "truncated or damaged"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path: Path, content: str | bytes, said: str) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        read(tmp_path, content)
    assert "r.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "cp1252"])
@pytest.mark.parametrize("pack", [bytes, gzip.compress])
def test_a_text_is_read_in_the_encoding_that_its_program_wrote(
    tmp_path: Path, encoding: str, pack: Callable[[bytes], bytes]
) -> None:
    text = HEADER.replace("\n", ",Temperatur [\u00b0C]\n") + ROWS.replace("\n", ",20\n")
    assert len(read(tmp_path, pack(text.encode(encoding)))) == 200


def test_errors_beyond_the_first_block_name_their_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_blocks, "BLOCK_CHARACTERS", 256)
    assert len(read(tmp_path, HEADER + ROWS)) == 200
    with pytest.raises(ValueError, match="line 152: t_s must increase"):
        read(tmp_path, HEADER + ROWS.replace("\n1.5", "\n1.2"))
    with pytest.raises(ValueError, match="line 152: t_s must be a finite number"):
        read(tmp_path, HEADER + ROWS.replace("1.50,", "1.5o,"))


def test_too_many_rows_are_refused_before_they_fill_the_memory(tmp_path: Path) -> None:
    packed = tmp_path / "long.csv.gz"
    with gzip.open(packed, "wt", compresslevel=1) as file:
        file.write(HEADER)
        for start in range(0, 2_100_000, 100_000):
            file.write("".join(f"{i},0,0\n" for i in range(start, start + 100_000)))
    began = time.perf_counter()
    with pytest.raises(ValueError, match="at most 2000000 rows"):
        read_record(packed, Rig("pull"))
    assert time.perf_counter() - began < 60


def test_other_endings_and_missing_files(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"must be text \(.csv.*got 'r.xlsx': export it as CSV"):
        read(tmp_path, "", name="r.xlsx")
    with pytest.raises(ValueError, match="No such file"):
        read_record(tmp_path / "none.csv", Rig("pull"))
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(ValueError, match="directory"):
        read_record(tmp_path / "folder.csv", Rig("pull"))


def test_speed_of_the_pull_may_stand_in_the_rig_file(tmp_path: Path) -> None:
    path = tmp_path / "p.csv"
    path.write_text("period_s,valley_N,peak_N\n" + "0.09,0.02,0.035\n" * 4)
    np.testing.assert_array_equal(read_record(path, Rig("periods", velocity_m_s=5e-4))["velocity_m_s"], 5e-4)
    with pytest.raises(ValueError, match=r"velocity_m_s must be a column of the record or a key under \[rig\]"):
        read_record(path, Rig("periods"))


def test_a_prediction_needs_the_driven_columns_only(tmp_path: Path) -> None:
    content = "period_s,duty,cycles\n0.1,0.3,10\n"
    assert len(read(tmp_path, content, "vibro_table", driven_only=True)) == 1
    with pytest.raises(ValueError, match="mean_velocity_m_s"):
        read(tmp_path, content, "vibro_table")
    with pytest.raises(ValueError, match="line 2: duty must be a share"):
        read(tmp_path, content.replace("0.3", "30"), "vibro_table", driven_only=True)


def test_a_prediction_needs_a_record_of_its_own_kind(tmp_path: Path) -> None:
    magnetic = "t_s,carriage_position_m,position_m\n" + ROWS
    with pytest.raises(ValueError, match="must be one of a pull rig; got the columns of kind magnetic"):
        read(tmp_path, magnetic, "pull", driven_only=True)
    assert len(read(tmp_path, magnetic, "magnetic", driven_only=True)) == 200
    assert len(read(tmp_path, HEADER.replace("force_N", "humidity") + ROWS, "pull", driven_only=True)) == 200


def test_a_coil_is_driven_by_current_or_voltage(tmp_path: Path) -> None:
    for name in ("coil_current_A", "coil_voltage_V"):
        assert name in read(tmp_path, f"t_s,{name},position_m\n" + ROWS, "coil").columns
    with pytest.raises(ValueError, match="'coil_current_A', in A; got 'coil_current_mA'"):
        read(tmp_path, "t_s,coil_current_mA,position_m\n" + ROWS, "coil")


def test_either_drive_column_makes_a_vibro_record(tmp_path: Path) -> None:
    for name in ("coil_voltage_V", "drive_on"):
        rows = "".join(f"{0.01 * i:.2f},{i % 2},0.001\n" for i in range(100))
        assert name in read(tmp_path, f"t_s,{name},position_m\n{rows}", "vibro").columns


def test_measured_data_are_read(shared: Path) -> None:
    data = shared / "data"
    assert len(read_record(data / "capsubot" / "mean_velocity.csv", Rig("vibro_table"))) > 50
    assert len(read_record(data / "emps" / "train.csv", Rig("axis"))) > 20_000
    assert len(read_record(data / "seeds" / "analytical_table2_periods.csv", Rig("periods", velocity_m_s=5e-4))) == 8
    assert len(read_record(data / "seeds" / "viscoelastic_table2_dma.csv", Rig("dma"))) == 15


@given(content=st.binary(max_size=300), kind=st.sampled_from(sorted(KINDS)), packed=st.booleans())
@example(content=b"", kind="pull", packed=True)
def test_any_bytes_are_a_record_or_one_sentence(tmp_path: Path, content: bytes, kind: str, packed: bool) -> None:
    try:
        read(tmp_path, gzip.compress(content) if packed else content, kind, "r.csv.gz" if packed else "r.csv")
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017


CELLS = st.sampled_from(
    ["0.1", "1", "2e3", "-1", "nan", "", "x", '"', '"1"', "1,5", " ", "1_0", "inf", "\u00b5", "\x0c"]
)


@given(
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=4), max_size=6),
    separator=st.sampled_from(",;\t"),
    kind=st.sampled_from(["dma", "vibro_table"]),
)
def test_any_table_under_a_right_header_is_a_record_or_one_sentence(
    tmp_path: Path, rows: list[list[str]], separator: str, kind: str
) -> None:
    header = [alternatives[0] for alternatives in KINDS[kind].layout.required()]
    try:
        record = read(tmp_path, "\n".join(separator.join(row) for row in [header, *rows]), kind)
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert all(np.isfinite(record[name]).all() for name in header)


def mapped(columns: dict[str, object], kind: str = "pull") -> Rig:
    return parse_rig({"rig": {"kind": kind}, **tomllib.loads(GUT), "columns": columns})


def test_numbers_without_a_header_are_columns_with_numbers(tmp_path: Path) -> None:
    path = tmp_path / "r.txt"
    path.write_text(ROWS)
    rig = mapped({"t_s": "column 1", "position_m": "column 2", "force_N": "column 3"})
    assert len(read_record(path, rig)) == 200


def test_a_rate_stands_for_times_that_nobody_logged(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("Kanal 1,Kanal 2\n" + "".join(line.split(",", 1)[1] + "\n" for line in ROWS.splitlines()))
    rig = mapped({"t_s": {"rate_Hz": 100.0}, "position_m": "Kanal 1", "force_N": {"column": "Kanal 2", "unit": "mN"}})
    record = read_record(path, rig)
    assert record["t_s"] == pytest.approx(0.01 * np.arange(200))
    assert record["force_N"][0] == pytest.approx(5e-5)


@pytest.mark.parametrize(
    ("separator", "written"),
    [
        (",", lambda v: f'"{v:,d}"'),
        ("\t", lambda v: f"{v:,d}"),
        (";", lambda v: f"{v:,d}".replace(",", ".")),
        (";", lambda v: f"{v:,d}".replace(",", "'")),
        (";", lambda v: f"{v:,d},00".replace(",", ".", v >= 1000)),
        ("\t", lambda v: f"{v:,d}.00"),
    ],
)
def test_groups_of_digits_are_one_number(tmp_path: Path, separator: str, written: Callable[[int], str]) -> None:
    path, um = tmp_path / "r.csv", [37 * k for k in range(200)]
    rows = (separator.join([f"{0.01 * k:.2f}", written(v), "0.05"]) for k, v in enumerate(um))
    path.write_text("\n".join([separator.join(["t_s", "place", "force_N"]), *rows]))
    record = read_record(path, mapped({"position_m": {"column": "place", "unit": "um"}}))
    assert record["position_m"] == pytest.approx(1e-6 * np.array(um))


LVM = """LabVIEW Measurement\t
Separator\tTab\t
Decimal_Separator\t,\t
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t100\t100\t
Y_Unit_Label\tMillimeters\tNewtons\t
X_Dimension\tTime\tTime\t
X0\t0,0000000000000000E+0\t0,0\t
Delta_X\t0,010000\t0,010000\t
***End_of_Header***\t\t\t
X_Value\tWeg\tKraft\tComment
"""


@pytest.mark.parametrize("with_x", [True, False])
def test_a_labview_measurement_states_its_units_and_its_clock(tmp_path: Path, with_x: bool) -> None:
    rows = [f"{k / 100 if with_x else ''}\t{0.1 * k:.4f}\t{0.05 + k % 7:.3f}".replace(".", ",") for k in range(100)]
    path = tmp_path / "r.lvm"
    path.write_text(LVM + "\n".join(rows) + "\n")
    with pytest.raises(ValueError, match="header must have") as refused:
        read_record(path, mapped({}))
    proposed = tomllib.loads("\n".join(refused.value.__notes__))["columns"]
    record = read_record(path, mapped(proposed))
    assert record["t_s"] == pytest.approx(0.01 * np.arange(100))
    assert record["position_m"] == pytest.approx(1e-4 * np.arange(100))
    path.write_text(LVM + "\n".join(rows[:60]) + "\n")
    with pytest.raises(ValueError, match="must hold the 100 samples that it states; got 60: it is cut off"):
        read_record(path, mapped(proposed))
    path.write_text(LVM.replace("Weg\tKraft", "Weg\tX_Value\tKraft") + "0,1\t1\t0,1\t2\n0,2\t1\t0,3\t2\n")
    with pytest.raises(ValueError, match="line 15: all channels must have one X_Value; got 0,2 and 0,3"):
        read_record(path, mapped(proposed))


def test_a_further_column_that_is_nearly_ours_is_left_out_with_a_word(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("t_s,position_m,force_N,load,velocity\n" + ROWS.replace("\n", ",3,0.1\n"))
    record = read_record(path, Rig("axis"))
    assert sum("is left out" in note for note in record.notes) == 2
    assert "velocity_m_s" not in record.columns
    path.write_text("t_s,position_m,force_N,load_N,velocity_m_s\n" + ROWS.replace("\n", ",off,\n"))
    assert sum("is left out" in note for note in read_record(path, Rig("axis")).notes) == 2
    path.write_text("position_m,force_N\n" + re.sub(r"(?m)^[^,]*,", "", ROWS))
    with pytest.raises(ValueError, match="must have the column t_s") as refused:
        read_record(path, Rig("axis"))
    assert "t_s = {rate_Hz = ...}" in refused.value.__notes__[0]
