"""`capsule export`: a plant or a found model as an FMU, a friction table, a MuJoCo body; a controller as C."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from hil.app.console import answer, json_text, note, output_to_notes
from hil.app.export.fmu_archive import FmuUnit, fmu
from hil.app.export.found import TEXT, Found, friction_table, not_mapped, read_found, tabled
from hil.app.shared_options import Json, LearnedModel, OwnEffects, Stage, argument, option
from hil.app.write import check_file, check_folder, check_targets, table_text, write_files
from hil.report.words import beyond_words, covered_words
from models.effects import Catalogue
from models.files.toml import check_word
from models.identification.finding import STAGES
from models.identification.validity import beyond

Made = tuple[Mapping[Path, str | bytes], dict[str, Any]]
IN_C: Final = ("controller", "estimator")
FORMS: Final = ("fmu", "table", "mujoco", *IN_C)
VOLTAGE: Final = "coil_voltage_V"
TABLE: Final = ("friction.csv", "friction.json")


def export(
    form: Annotated[str, argument("fmu/table/mujoco/controller/estimator")],
    out: Annotated[Path, option("--out", "FILE/DIR")],
    *,
    scenario: Annotated[Path | None, argument("FILE.toml", "scenario or deployment file")] = None,
    model: LearnedModel = None,
    rig: Annotated[Path | None, option("--rig", "RIG.toml", "rig file")] = None,
    stage: Stage = "augmented",
    driven: Annotated[str, option("--driven", "COLUMN")] = "",
    single: Annotated[bool, typer.Option("--float32")] = False,
    particles: Annotated[int | None, typer.Option("--particles", metavar="N", min=50, max=1000)] = None,
    short: Annotated[bool, typer.Option("--short-plan")] = False,
    json_output: Json = False,
    effects: OwnEffects,
) -> None:
    """Write a scenario's plant or a rig's model, complete or not at all, and say what the form cannot hold; or a
    deployment's controller.
    """
    check_word(form, "form", FORMS)
    if form in IN_C:
        if scenario is None or rig is not None or driven:
            raise ValueError(f"export {form} must have DEPLOYMENT.toml, and neither --rig nor --driven")
        check_word(stage, "--stage", STAGES)
    elif scenario is not None and (model is not None or rig is not None):
        raise ValueError(f"SCENARIO.toml must stand without --model and --rig; got {scenario} with them")
    elif scenario is not None and form != "fmu":
        raise ValueError(f"export {form} must have --model and --rig; a plant's truth goes into an FMU alone")
    elif scenario is None and (model is None or rig is None):
        raise ValueError("export must have SCENARIO.toml, or both --model MODEL.toml and --rig RIG.toml; got neither")
    elif driven not in ("", VOLTAGE):
        raise ValueError(f"--driven must be {VOLTAGE}; got {driven!r}")
    elif driven and (form != "fmu" or scenario is not None):
        raise ValueError(f"--driven must stand with export fmu --model; got it with export {form}")
    for name, asked in (("--float32", single), ("--particles", particles), ("--short-plan", short)):
        if asked and form not in IN_C:
            raise ValueError(f"{name} must stand with export {' or '.join(IN_C)}; got it with export {form}")
    given, catalogue = [path for path in (scenario, model, rig) if path is not None], Catalogue.read(effects)
    check_targets(_targets(form, out), "--out", given)
    with output_to_notes():
        if form in IN_C and scenario is not None:
            from hil.app.export.controller import Asked, exported

            made, found = exported(Asked(scenario, model, stage, form, single, particles, short), catalogue)
            files: Mapping[Path, str | bytes] = {out / name: content for name, content in made.items()}
        elif scenario is not None:
            files, found = _plant(scenario, out)
        elif rig is not None and model is not None:
            learned = read_found(rig, model, stage, driven, catalogue)
            files, found = {"fmu": _model, "table": _table, "mujoco": _mujoco}[form](learned, out)
            found |= _validity(learned, form)
    check_targets(list(files), "--out", given)
    for folder in sorted({path.parent for path in files}):
        check_folder(folder, "--out")
    write_files(files)
    found = {"form": form, "files": [str(path) for path in files], **found}
    if form in IN_C:
        lines = [TEXT("written", out=shlex.quote(str(out)), **found)]
    else:
        missing = (f"not mapped: {name}: {why}" for name, why in found["not_mapped"].items())
        lines = [*(f"{form}: {path}" for path in files), *missing]
    answer(json_output, found, *lines)


def _validity(found: Found, form: str) -> dict[str, Any]:
    """The ranges of the model's records, and where the speeds and places of a friction table leave them, noted."""
    left = {} if form == "fmu" else beyond(found.covered, tabled())
    if found.covered:
        note(beyond_words(left) if left else covered_words(found.covered))
    return {"validity": {name: list(ends) for name, ends in found.covered.items()}, "beyond_records": left}


def _targets(form: str, out: Path) -> list[Path]:
    if form in ("fmu", "mujoco"):
        return [check_file(out, "--out", (".fmu",) if form == "fmu" else (".xml",))]
    if out.exists():
        check_folder(out, "--out")
    return [out / name for name in TABLE if form == "table"]


def _plant(scenario: Path, out: Path) -> Made:
    from hil.app.export.fmu_plant import plant_unit, read_truth

    run, rig = read_truth(scenario)
    return _archive(out, plant_unit(run.name or scenario.stem, rig, run.duration_s), {"sensors": TEXT("sensors")})


def _model(found: Found, out: Path) -> Made:
    from hil.app.export.fmu_model import model_unit

    return _archive(out, model_unit(out.stem, found), found.late())


def _archive(out: Path, unit: FmuUnit, missing: Mapping[str, str]) -> Made:
    listed = [{"name": v.name, "causality": v.causality, "unit": v.unit, "is": v.description} for v in unit.variables]
    return {out: fmu(unit)}, {"variables": listed, "not_mapped": missing}


def _table(found: Found, out: Path) -> Made:
    table, missing = friction_table(found), not_mapped(found)
    columns = {name: TEXT(f"column.{name}") for name in table}
    about = {"rig": found.rig.kind, "stage": found.stage, "columns": columns, "parameters": found.values.spelled()}
    files = {out / TABLE[0]: table_text(table), out / TABLE[1]: json_text({**about, "not_mapped": missing})}
    return files, {"rows": len(table["speed_m_s"]), "not_mapped": missing}


def _mujoco(found: Found, out: Path) -> Made:
    from hil.app.export.mujoco import body

    text, numbers, missing = body(found)
    return {out: text}, {"fitted": numbers, "not_mapped": missing}
