"""`capsule export`: a plant or a found model as an FMU, as a friction table, as a MuJoCo body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hil.app.console import json_text, output_to_notes, print_json, summary
from hil.app.export.found import Found, read_found
from hil.app.write import check_file, check_folder, check_targets, table_text, write_files
from models.parameter import nearest

FORMS: Final = ("fmu", "table", "mujoco")
VOLTAGE: Final = "coil_voltage_V"
TABLE: Final = ("friction.csv", "friction.json")


@dataclass(frozen=True)
class Asked:
    """What the command line said: a scenario's plant, or the model of a rig at a stage."""

    form: str
    scenario: Path | None
    model: Path | None
    rig: Path | None
    out: Path
    stage: str
    driven: str = ""


def export(asked: Asked, *, json_output: bool = False) -> None:
    """Write what was asked for, complete or not at all, and say what of it the form could not carry.

    Raises ValueError of one sentence.
    """
    if asked.form not in FORMS:
        raise ValueError(f"form must be one of {', '.join(FORMS)}; got {asked.form!r}; {nearest(asked.form, FORMS)}")
    if asked.scenario is not None and (asked.model is not None or asked.rig is not None):
        raise ValueError(f"SCENARIO.toml must stand without --model and --rig; got {asked.scenario} with them")
    if asked.scenario is not None and asked.form != "fmu":
        raise ValueError(f"export {asked.form} must have --model and --rig; a plant's truth goes into an FMU alone")
    if asked.scenario is None and (asked.model is None or asked.rig is None):
        raise ValueError("export must have SCENARIO.toml, or both --model MODEL.toml and --rig RIG.toml; got neither")
    if asked.driven not in ("", VOLTAGE):
        raise ValueError(f"--driven must be {VOLTAGE}; got {asked.driven!r}")
    if asked.driven and (asked.form != "fmu" or asked.scenario is not None):
        raise ValueError(f"--driven must stand with export fmu --model; got it with export {asked.form}")
    targets = _targets(asked)
    check_targets(targets, "--out", [p for p in (asked.scenario, asked.model, asked.rig) if p is not None])
    with output_to_notes():
        files, found = _made(asked)
    if asked.form == "table":
        check_folder(asked.out, "--out")
    write_files(files)
    found = {"form": asked.form, "files": [str(path) for path in targets], **found}
    if json_output:
        print_json(found)
        return
    console = summary()
    for path in targets:
        console.print(f"{asked.form}: {path}", markup=False, soft_wrap=True)
    for name, why in found["not_mapped"].items():
        console.print(f"not mapped: {name}: {why}", markup=False, soft_wrap=True)


def _targets(asked: Asked) -> list[Path]:
    if asked.form == "table":
        if asked.out.exists():
            check_folder(asked.out, "--out")
        return [asked.out / name for name in TABLE]
    return [check_file(asked.out, "--out", (".fmu",) if asked.form == "fmu" else (".xml",))]


def _made(asked: Asked) -> tuple[Mapping[Path, str | bytes], dict[str, Any]]:
    """The files with their content, and what is said of them."""
    if asked.scenario is not None:
        return _plant(asked.scenario, asked.out)
    assert asked.rig is not None
    assert asked.model is not None
    found = read_found(asked.rig, asked.model, asked.stage, asked.driven)
    if asked.form == "fmu":
        return _model(found, asked.out)
    return _table(found, asked.out) if asked.form == "table" else _mujoco(found, asked.out)


def _plant(scenario: Path, out: Path) -> tuple[Mapping[Path, str | bytes], dict[str, Any]]:
    from hil.app.export.fmu.package import fmu
    from hil.app.export.fmu.plant_unit import plant_unit, read_truth

    run, rig = read_truth(scenario)
    unit = plant_unit(run.name or scenario.stem, rig, run.duration_s)
    missing = {"sensors": "noise, rate and delay of the scenario's instruments: the outputs are the truth"}
    return {out: fmu(unit)}, {"variables": _listed(unit.variables), "not_mapped": missing}


def _model(found: Found, out: Path) -> tuple[Mapping[Path, str | bytes], dict[str, Any]]:
    from hil.app.export.fmu.model_unit import model_unit
    from hil.app.export.fmu.package import fmu

    unit = model_unit(out.stem, found)
    return {out: fmu(unit)}, {"variables": _listed(unit.variables), "not_mapped": found.late()}


def _listed(variables: Any) -> list[dict[str, str]]:
    return [{"name": v.name, "causality": v.causality, "unit": v.unit, "is": v.description} for v in variables]


def _table(found: Found, out: Path) -> tuple[Mapping[Path, str | bytes], dict[str, Any]]:
    from hil.app.export.table import UNITS, friction_table

    table = friction_table(found)
    about = {
        "rig": found.rig.kind,
        "stage": found.stage,
        "columns": UNITS,
        "parameters": found.values.spelled(),
        "not_mapped": table.not_mapped,
    }
    files = {out / TABLE[0]: table_text(table.columns), out / TABLE[1]: json_text(about)}
    return files, {"rows": len(table.columns["speed_m_s"]), "not_mapped": table.not_mapped}


def _mujoco(found: Found, out: Path) -> tuple[Mapping[Path, str | bytes], dict[str, Any]]:
    from hil.app.export.mujoco import body

    text, numbers, missing = body(found)
    return {out: text}, {"fitted": numbers, "not_mapped": missing}
