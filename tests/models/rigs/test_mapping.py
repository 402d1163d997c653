"""`[columns]` of a rig file: another's names, units, signs and offsets, in CSV files; and tables to paste."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.files import csv_reader
from models.files.units import factor, fitting
from models.records.found_columns import toml_lines
from models.records.record import Record, read_record
from models.rigs.mapping import ColumnMap, MappedColumn
from models.rigs.reader import parse_rig

T = 0.01 * np.arange(200)
X = 0.05 * np.sin(3 * T)
F = 0.03 + 0.005 * np.cos(3 * T)
ROWS = "\n".join(f"{1e3 * t:.6g},{1e3 * x:.9g},{1e3 * f:.9g}" for t, x, f in zip(T, X, F, strict=True)) + "\n"
DEGREES = "\n".join(f"{t:.6g};{x:.9g};{f:.9g}".replace(".", ",") for t, x, f in zip(T, X, F, strict=True)) + "\n"


def read(folder: Path, text: str, columns: dict[str, Any] | None = None, name: str = "r.csv") -> Record:
    path = folder / name
    path.write_text(text)
    return read_record(path, parse_rig({"rig": {"kind": "axis"}, "columns": columns or {}}))


def proposal(folder: Path, text: str, name: str = "r.csv") -> dict[str, Any]:
    """The table `[columns]` that the refusal of a file proposes."""
    with pytest.raises(ValueError, match="this table in the rig file reads it") as caught:
        read(folder, text, name=name)
    assert "\n" not in str(caught.value)
    return tomllib.loads("\n".join(caught.value.__notes__))["columns"]


def assert_same(record: Record) -> None:
    np.testing.assert_allclose(record["t_s"], T, atol=1e-9)
    np.testing.assert_allclose(record["position_m"], X, atol=1e-9)
    np.testing.assert_allclose(record["force_N"], F, atol=1e-9)


@given(
    target=st.sampled_from(["position_m", "force_N"]),
    sign=st.sampled_from([1, -1]),
    offset=st.floats(-50, 50),
    data=st.data(),
)
def test_names_units_signs_and_offsets_are_undone(
    tmp_path: Path, target: str, sign: int, offset: float, data: st.DataObject
) -> None:
    unit = data.draw(st.sampled_from(fitting(target.rpartition("_")[2])))
    scale = factor(unit, target.rpartition("_")[2])
    assert scale is not None
    raw = sign * X / scale + offset
    text = f"t_s,raw,{'force_N' if target == 'position_m' else 'position_m'}\n"
    text += "".join(f"{t:.6g},{r!r},{f!r}\n" for t, r, f in zip(T, raw.tolist(), F.tolist(), strict=True))
    found = read(tmp_path, text, {target: {"column": "raw", "unit": unit, "sign": sign, "offset": offset}})
    np.testing.assert_allclose(found[target], X, atol=1e-12 * max(1.0, abs(scale * offset)) + 1e-12)
    assert set(found.columns) == {"t_s", "position_m", "force_N"}


def test_the_example_of_the_documentation(tmp_path: Path) -> None:
    text = "Time,pos,load [mN]\n" + "".join(f"{t},2.5,30\n" for t in range(200))
    columns = {
        "t_s": {"column": "Time", "unit": "ms"},
        "position_m": {"column": "pos", "unit": "mm", "sign": -1, "offset": 0.5},
        "force_N": "load [mN]",
    }
    record = read(tmp_path, text, columns)
    assert record["position_m"][0] == pytest.approx(-0.002)
    assert record["force_N"][0] == pytest.approx(0.03)
    assert record["t_s"][1] == pytest.approx(1e-3)


def test_a_range_holds_for_what_comes_out(tmp_path: Path) -> None:
    text = "t_s,pos,force_N\n" + "".join(f"{t},{t},0\n" for t in range(200))
    with pytest.raises(ValueError, match=r"r\.csv, line 103: position_m must be between -100 and 100 m; got 101"):
        read(tmp_path, text, {"position_m": "pos"})
    with pytest.raises(ValueError, match=r"r\.csv, line 3: pos must be a finite number; got 'x'"):
        read(tmp_path, text.replace("1,1,", "1,x,", 1), {"position_m": "pos"})


def test_further_columns_stay_and_ours_of_the_same_name_go(tmp_path: Path) -> None:
    text = "t_s,position_m,force_N,pos,note\n" + "".join(f"{t},1,2,{t / 100},7\n" for t in range(200))
    record = read(tmp_path, text, {"position_m": "pos"})
    assert list(record.columns) == ["t_s", "position_m", "force_N", "note"]
    assert record["position_m"][-1] == pytest.approx(1.99)


def test_a_converted_file_is_read_with_the_same_rig_file(tmp_path: Path) -> None:
    text = "t_s,position_m,force_N\n" + "".join(f"{t},{t / 100},2\n" for t in range(200))
    assert read(tmp_path, text, {"position_m": {"column": "pos", "unit": "mm"}})["position_m"][-1] == 1.99


@pytest.mark.parametrize(
    ("columns", "said"),
    [
        ({"positon_m": "pos"}, r"\[columns\] key must be a column of kind 'axis'; got 'positon_m'; did you mean 'posi"),
        (
            {"position_m": {"column": "pos", "unit": "mn"}},
            "unit of position_m must be one that converts to m; got 'mn'; did you",
        ),
        (
            {"position_m": {"column": "pos", "unit": "mN"}},
            "unit of position_m must be one that converts to m; got 'mN'",
        ),
        ({"position_m": {"column": "pos", "sign": 2}}, r"\[columns.position_m\] sign must be one of 1 or -1; got 2"),
        ({"position_m": {"column": "pos", "ofset": 2}}, r"key must be a known one; got 'ofset'; did you mean 'offset'"),
        ({"position_m": {"unit": "mm"}}, r"\[columns\] position_m must have a 'column', or for t_s a 'rate_Hz'"),
        ({"position_m": {"column": "pos", "offset": "a"}}, "offset must be a finite number; got 'a'"),
        ({"position_m": 3}, r"\[columns\] position_m must be the name of a column"),
        (
            {"position_m": {"column": "poss"}},
            r"r.csv: \[columns\] position_m must name a column .*; got 'poss'",
        ),
    ],
)
def test_what_is_wrong_with_the_table_is_said(tmp_path: Path, columns: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said) as caught:
        read(tmp_path, "t_s,pos,force_N\n1,2,3\n", columns)
    assert "\n" not in str(caught.value)


FILES = {
    "brackets": ("r.csv", "Time(ms),Position [mm],force (mN)\n" + ROWS),
    "endings": ("r.csv", "t_ms,pos_mm,F / mN\n" + ROWS),
    "row of units": ("r.csv", "Time,Displacement,Load\nms,mm,mN\n" + ROWS),
    "units in brackets": ("r.csv", "Time,Displacement,Load\n[ms],[mm],[mN]\n" + ROWS),
    "comments": ("r.csv", "# made by a rig\n# on a day\nTime [ms],x [mm],Load [mN]\n" + ROWS),
    "header in a comment": ("r.csv", "# Time [ms],x [mm],Load [mN]\n" + ROWS),
    "lines about the file": ("r.csv", "Operator,Jane\nRate,100,Hz\n\nTime [ms],x [mm],Load [mN]\n" + ROWS),
    "tabs": ("r.tsv", ("Zeit,Weg,Kraft\nms,mm,mN\n" + ROWS).replace(".", ";").replace(",", "\t").replace(";", ",")),
    "another language by units": ("r.txt", "a [ms],b [mm],c [mN]\n" + ROWS),
    "our names, other units": ("r.csv", "t_s,position_m,force_N\nms,mm,mN\n" + ROWS),
}


@pytest.mark.parametrize("case", FILES)
def test_the_table_that_is_proposed_reads_the_file(tmp_path: Path, case: str) -> None:
    name, text = FILES[case]
    assert_same(read(tmp_path, text, proposal(tmp_path, text, name), name))


def test_our_names_with_our_units_below_are_read(tmp_path: Path) -> None:
    assert_same(read(tmp_path, "t_s;position_m;force_N\ns;m;N\n" + DEGREES))


def test_a_unit_that_nothing_states_is_pointed_out(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="'t_s', in s; got 't'") as caught:
        read(tmp_path, "t,x,F [mN]\n" + ROWS)
    assert caught.value.__notes__ == [
        '[columns]\nt_s = {column = "t", unit = "s"}  # the file states no unit; dates and times of day need none\n'
        'position_m = {column = "x", unit = "m"}  # the file states no unit\nforce_N = {column = "F [mN]", unit = "mN"}'
    ]


def test_what_is_already_mapped_stays_in_the_proposal(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="column force_N") as caught:
        read(tmp_path, "Time,x,Load\nms,mm,mN\n" + ROWS, {"t_s": "Time", "position_m": {"column": "x", "sign": -1}})
    found = tomllib.loads("\n".join(caught.value.__notes__))["columns"]
    assert found["position_m"]["sign"] == -1
    assert found["force_N"] == {"column": "Load", "unit": "mN"}


def test_nothing_is_proposed_where_nothing_is_like_ours(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="header must have the column") as caught:
        read(tmp_path, "col1,col2\n1,2\n")
    assert not hasattr(caught.value, "__notes__")


def test_two_positions_are_told_apart_by_their_words(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time [s],capsule pos [mm],magnet pos [mm]\n" + ROWS)
    rig = {"rig": {"kind": "magnetic", "magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02}}
    gut = {"capsule": {"radius_m": 6.5e-3, "cylinder_length_m": 0.02, "mass_kg": 4e-3}}
    tissue = {"preset": "jejunum", "wall_thickness_m": 2.5e-3, "contact_angle_deg": 60.0, "nose_force_angle_deg": 30.0}
    tissue |= {"friction_coefficient": 0.08, "mucus_thickness_m": 3e-5, "recovery_time_s": 0.05}
    with pytest.raises(ValueError, match="carriage_position_m") as caught:
        read_record(path, parse_rig({**rig, **gut, "tissue": tissue}))
    found = tomllib.loads("\n".join(caught.value.__notes__))["columns"]
    assert found["carriage_position_m"]["column"] == "magnet pos [mm]"
    assert found["position_m"]["column"] == "capsule pos [mm]"


@pytest.mark.parametrize(
    ("header", "sources"),
    [
        ("time,q,qd,tau_measured,tau_command", ("time", "q", "tau_measured", "qd")),
        ("time,q3,dq3,ddq3,tau_J_d_cmd,tau_J3", ("time", "q3", "tau_J3", "dq3")),
        ("timestamp,target_angle,actual_angle,omega,torque", ("timestamp", "actual_angle", "torque", "omega")),
    ],
)
def test_a_joint_is_recognised_by_the_words_of_robots(tmp_path: Path, header: str, sources: tuple[str, ...]) -> None:
    """What was measured goes before what was commanded."""
    path = tmp_path / "r.csv"
    path.write_text(header + "\n" + ROWS)
    with pytest.raises(ValueError, match="position_m, force_N, or t_s, angle_rad, torque_N_m") as caught:
        read_record(path, parse_rig({"rig": {"kind": "axis"}}))
    found = tomllib.loads("\n".join(caught.value.__notes__))["columns"]
    ours = ("t_s", "angle_rad", "torque_N_m", "velocity_rad_s")
    assert tuple(found[name]["column"] for name in ours) == sources


def test_a_sensor_that_was_logged_in_volts_is_told_by_a_scale(tmp_path: Path) -> None:
    """The lines of a logger that gives each channel its own time, under one name."""
    path = tmp_path / "ni.csv"
    top = 'Interval,0.01,Interval,0.01\nChannel name,"Force",Channel name,"Input 1"\nUnit,"V",Unit,"V"\n'
    t = 0.01 * np.arange(200)
    path.write_text(top + "".join(f"{k},{0.5 + 1e-3 * n},{k},{n}\n" for n, k in enumerate(t)))
    with pytest.raises(ValueError, match="'force_N', in N; got 'Force'") as caught:
        read_record(path, parse_rig({"rig": {"kind": "axis"}}))
    note = "\n".join(caught.value.__notes__)
    assert '# force_N = {column = "Force", unit = "N", scale = ...}  # what 1 V is in N' in note
    columns = {
        "t_s": {"column": "Channel name", "unit": "s"},
        "force_N": {"column": "Force", "unit": "mN", "scale": 200.0, "offset": 0.5, "sign": -1},
        "position_m": {"column": "Input 1", "scale": 1e-4},
    }
    record = read_record(path, parse_rig({"rig": {"kind": "axis"}, "columns": columns}))
    np.testing.assert_allclose(record["force_N"], -0.2 * 1e-3 * np.arange(200), atol=1e-12)
    np.testing.assert_allclose(record["position_m"], 1e-4 * np.arange(200), atol=1e-12)


def test_a_column_that_is_called_by_its_unit_alone_is_recognised(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="header must have") as caught:
        read(tmp_path, "ms,Pos [mm],Load [N],Not selected,Not selected\n1,2,3,0,0\n")
    found = tomllib.loads("\n".join(caught.value.__notes__))["columns"]
    assert found["t_s"] == {"column": "ms", "unit": "ms"}


@given(
    st.text(min_size=1, max_size=30).filter(lambda text: max(text) < "\ud800" or min(text) > "\udfff"),
    st.sampled_from([1, -1]),
    st.floats(-1e9, 1e9),
)
def test_a_proposed_table_is_toml(column: str, sign: int, offset: float) -> None:
    entry = MappedColumn("position_m", column, "mm", sign, offset)
    table = tomllib.loads(toml_lines([entry]))
    assert parse_rig({"rig": {"kind": "axis"}, **table}).columns == ColumnMap((entry,))


@pytest.mark.parametrize(
    ("header", "sources"),
    [
        ("speed (mm/s);normal load (N);COF", ("speed (mm/s)", "COF", "normal load (N)")),
        ("v [mm/s];Load (N);mu", ("v [mm/s]", "mu", "Load (N)")),
        ("speed (mm/s);normal load (N);friction force (N)", ("speed (mm/s)", "friction force (N)", "normal load (N)")),
        ("velocity [mm/s];Fn [N];Ft [N]", ("velocity [mm/s]", "Ft [N]", "Fn [N]")),
    ],
)
def test_a_table_of_friction_is_recognised_by_the_words_of_tribology(
    tmp_path: Path, header: str, sources: tuple[str, str, str]
) -> None:
    path = tmp_path / "table.csv"
    path.write_text(f"{header}\n1;0.5;0.04\n2;0.5;0.05\n5;0.5;0.06\n9;0.5;0.07\n")
    rig = {"rig": {"kind": "friction"}, "contact": {"friction_coefficient": 0.1}}
    with pytest.raises(ValueError, match="this table in the rig file reads it") as caught:
        read_record(path, parse_rig(rig))
    columns = tomllib.loads("\n".join(caught.value.__notes__))["columns"]
    assert tuple(entry["column"] for entry in columns.values()) == sources
    record = read_record(path, parse_rig({**rig, "columns": columns}))
    np.testing.assert_allclose(record["velocity_m_s"], [1e-3, 2e-3, 5e-3, 9e-3])
    np.testing.assert_allclose(record["load_N"], 0.5)


def test_an_angle_that_begins_again_goes_on_over_blocks_and_gaps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(csv_reader, "BLOCK_CHARACTERS", 256)
    rig = parse_rig({"rig": {"kind": "axis"}, "columns": {"angle_rad": {"column": "q", "unit": "deg", "wrap": 360}}})
    t = np.arange(0, 4, 0.01)
    angle = 700 * np.sin(2 * t)
    rows = zip(t, np.mod(angle, 360), np.cos(2 * t), strict=True)
    text = "t_s,q,torque_N_m\n" + "".join(f"{a:.4f},{b:.6f},{c:.6f}\n" for a, b, c in rows)
    (tmp_path / "turns.csv").write_text(text)
    read = read_record(tmp_path / "turns.csv", rig)
    assert np.degrees(read["angle_rad"]) == pytest.approx(angle, abs=1e-5)
