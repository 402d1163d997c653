"""The generated parts of docs/*.md say what the schema and the catalogue of effects say."""

import re
from pathlib import Path
from typing import Any

import pytest

from hil.app.scenario.deployment import OWN_TABLES
from hil.app.scenario.scenario import BUS_TABLES
from hil.app.sil import loop
from models.effects import EFFECTS
from models.rigs import magnets, reader, schema, tables
from models.rigs.kinds import KINDS
from models.rigs.reader import parse_rig
from models.rigs.schema import key_unit
from models.rigs.tables import PaperTissueTable
from tests.hil.app.docs.api import described
from tests.hil.app.docs.keys import DEPLOYMENT_TABLES, deployment_keys, rig_tables
from tests.hil.app.docs.pages import PARTS, filled, main
from tests.places import ROOT

PAGES = sorted((ROOT / "docs").rglob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_generated_parts_are_current(page: Path) -> None:
    """`python -m tests.hil.app.docs.pages` writes them anew."""
    text = page.read_text(encoding="utf-8")
    assert filled(text) == text, "run: python -m tests.hil.app.docs.pages"


def test_every_part_stands_on_a_page() -> None:
    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [name for name in PARTS if f"<!-- generated: {name} -->" not in pages] == []


def test_every_key_of_a_deployment_has_a_meaning() -> None:
    rows = [line for line in deployment_keys().splitlines() if line.startswith("| `")]
    assert [row for row in rows if row.endswith("| |")] == []


def test_every_table_of_the_schema_is_listed() -> None:
    listed = {model for models in rig_tables().values() for model in models}
    known = {t for t in (vars(tables) | vars(magnets)).values() if isinstance(t, type) and issubclass(t, schema.Table)}
    assert known - {schema.Table} == listed
    keys = [(table, key) for table in listed for key in table.model_fields]
    assert [key for table, key in keys if not schema.field_of(table, key).description] == []
    assert [k for t, k in keys if t.model_fields[k].is_required() and not schema.example(t, k)] == []


def test_every_table_of_a_deployment_is_listed() -> None:
    assert {re.findall(r"\w+", name)[0] for name in DEPLOYMENT_TABLES} == {*OWN_TABLES, *BUS_TABLES} - {
        "faults",
        "limits",
    }


def test_every_effect_is_on_the_page() -> None:
    page = (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")
    assert [effect.id for effect in EFFECTS if f"### {effect.id}\n" not in page] == []


def test_a_unit_is_read_from_the_end_of_a_name() -> None:
    assert [key_unit(name) for name in ("spring_damping_N_s_per_m", "speed_mm_s", "preset")] == ["N s/m", "mm/s", ""]


def test_pages_are_filled_between_their_markers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- generated: columns -->\nold\n<!-- end -->\nafter\n", encoding="utf-8")
    main(tmp_path)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n<!-- generated: columns -->\n\n| kind |")
    assert text.endswith("\n<!-- end -->\nafter\n")
    assert capsys.readouterr().out == f"{page}\n"


def test_an_unknown_marker_is_refused() -> None:
    with pytest.raises(ValueError, match=r"generated part must be one of columns, .*; got 'nothing'"):
        filled("<!-- generated: nothing -->\n<!-- end -->")


def test_a_function_is_described_by_signature_and_docstring() -> None:
    text = described(reader)
    assert "## read_rig\n\n```python\nread_rig(path: Path) -> Rig\n```\n\nRead a rig file;" in text
    assert "## _kind" not in text


def test_a_long_signature_has_a_parameter_a_line_and_keeps_its_star() -> None:
    text = described(loop)
    assert "```python\nrun_sil(\n    scenario: SilScenario,\n" in text
    assert "\n    *,\n    recorder: Recorder | None = None,\n" in text
    assert "\n) -> SilTrace\n```" in text


FULL: dict[str, Any] = {
    "rig": {},
    "capsule": {"radius_m": 6.5e-3, "cylinder_length_m": 0.02, "mass_kg": 4e-3},
    "tissue": PaperTissueTable().model_dump(exclude={"lumen_diameter_m"}),
    "drive": {"inner_mass_kg": 0.01, "spring_stiffness_N_per_m": 80.0, "force_N": 1.0, "reaction_on_body": True},
    "surface": {},
    "axis": {},
    "contact": {},
    "noise": {},
}
HEADS: dict[str, dict[str, float]] = {
    "magnetic": {"magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02},
    "coil": {"force_constant_N_per_A": 0.5},
    "periods": {"velocity_m_s": 0.01},
}
SURFACES = {
    "plate": {"kind": "plate", "friction_coefficient": 0.2},
    "gut": {"kind": "gut"},
    "air": {"kind": "air"},
}
UNSTATED = ("magnetic", "coil")
"""Kinds whose surface is the gut where the file says nothing."""
ROWS = re.findall(
    r"^\| ((?:`[a-z_]+`(?:, )?)+)(?: \w+ \w+ (plate|gut|air))? \| (`\[rig\]`[^|]*) \| ([^|]*) \|$",
    (ROOT / "docs" / "rig-and-record-files.md").read_text(encoding="utf-8"),
    re.MULTILINE,
)


def test_every_kind_of_rig_has_its_row() -> None:
    kinds = [kind for row in ROWS for kind in re.findall(r"\w+", row[0])]
    assert sorted({*kinds}) == sorted(KINDS)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]} {row[1]}")
def test_a_kind_of_rig_takes_the_tables_of_its_row(row: tuple[str, str, str, str]) -> None:
    needed, optional = (set(re.findall(r"\w+", cell)) for cell in row[2:])
    for kind in re.findall(r"\w+", row[0]):
        tables = FULL | {"rig": {"kind": kind, **HEADS.get(kind, {})}, "surface": SURFACES[row[1] or "gut"]}
        allowed = {name: tables[name] for name in needed | optional}
        assert parse_rig(allowed).kind == kind
        assert parse_rig({name: tables[name] for name in needed}).kind == kind
        for name in needed - {"surface"} if kind in UNSTATED else needed:
            with pytest.raises(ValueError, match=rf"table \[{name}\] must be there"):
                parse_rig({key: table for key, table in allowed.items() if key != name})
        for name in tables.keys() - allowed.keys() - ({"surface"} if kind in UNSTATED else set()):
            with pytest.raises(ValueError, match=rf"table \[{name}\] must not be there"):
                parse_rig(allowed | {name: tables[name]})
