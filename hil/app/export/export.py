"""`capsule export`: a plant or a found model as an FMU, a friction table, a MuJoCo body; a controller as C."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from hil.app.console import answer, json_text, note, output_to_notes
from hil.app.export.fmu_archive import FmuUnit, fmu
from hil.app.export.found import TEXT, Found, read_found
from hil.app.export.table import friction_table, tabled
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
    form: Annotated[str, argument("fmu/table/mujoco/controller/estimator", "What to write.")],
    out: Annotated[Path, option("--out", "FILE/DIR", "An .fmu, an .xml for mujoco, else a folder.")],
    *,
    scenario: Annotated[
        Path | None,
        argument(
            "FILE.toml",
            "The scenario whose plant becomes an FMU; the deployment of a controller or estimator.",
            "scenario or deployment file",
        ),
    ] = None,
    model: LearnedModel = None,
    rig: Annotated[
        Path | None, option("--rig", "RIG.toml", "The rig file that the model belongs to.", "rig file")
    ] = None,
    stage: Stage = "augmented",
    driven: Annotated[str, option("--driven", "COLUMN", "coil_voltage_V: a coil is commanded by its voltage.")] = "",
    single: Annotated[bool, typer.Option("--float32", help="A controller or estimator in single precision.")] = False,
    particles: Annotated[
        int | None,
        typer.Option("--particles", metavar="N", min=50, max=1000, help="Of a controller's estimator; else 300."),
    ] = None,
    short: Annotated[
        bool, typer.Option("--short-plan", help="An MPC of 20 stages and one SQP step a tick, not 30 and two.")
    ] = False,
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
        _in_c((scenario, model, stage, form, single, particles, short), out, Catalogue.read(effects), json_output)
        return
    for name, given in (("--float32", single), ("--particles", particles), ("--short-plan", short)):
        if given:
            raise ValueError(f"{name} must stand with export {' or '.join(IN_C)}; got it with export {form}")
    if scenario is not None and (model is not None or rig is not None):
        raise ValueError(f"SCENARIO.toml must stand without --model and --rig; got {scenario} with them")
    if scenario is not None and form != "fmu":
        raise ValueError(f"export {form} must have --model and --rig; a plant's truth goes into an FMU alone")
    if scenario is None and (model is None or rig is None):
        raise ValueError("export must have SCENARIO.toml, or both --model MODEL.toml and --rig RIG.toml; got neither")
    if driven not in ("", VOLTAGE):
        raise ValueError(f"--driven must be {VOLTAGE}; got {driven!r}")
    if driven and (form != "fmu" or scenario is not None):
        raise ValueError(f"--driven must stand with export fmu --model; got it with export {form}")
    targets, catalogue = _targets(form, out), Catalogue.read(effects)
    check_targets(targets, "--out", [p for p in (scenario, model, rig) if p is not None])
    with output_to_notes():
        if scenario is not None:
            files, found = _plant(scenario, out)
        elif rig is not None and model is not None:
            make = {"fmu": _model, "table": _table, "mujoco": _mujoco}[form]
            learned = read_found(rig, model, stage, driven, catalogue)
            files, found = make(learned, out)
            found |= _validity(learned, form)
    if form == "table":
        check_folder(out, "--out")
    write_files(files)
    found = {"form": form, "files": [str(path) for path in targets], **found}
    missing = (f"not mapped: {name}: {why}" for name, why in found["not_mapped"].items())
    answer(json_output, found, *(f"{form}: {path}" for path in targets), *missing)


def _in_c(
    words: tuple[Path, Path | None, str, str, bool, int | None, bool], out: Path, known: Catalogue, json_output: bool
) -> None:
    """Write the folder of a compiled controller or estimator."""
    from hil.app.export.controller import Asked, exported

    asked = Asked(*words)
    check_word(asked.stage, "--stage", STAGES)
    if out.exists():
        check_folder(out, "--out")
    with output_to_notes():
        files, facts = exported(asked, known)
    contents = {out / name: content for name, content in files.items()}
    check_targets(list(contents), "--out", [p for p in (asked.path, asked.model) if p is not None])
    for folder in sorted({target.parent for target in contents}):
        check_folder(folder, "--out")
    write_files(contents)
    found = {"form": asked.form, "files": [str(target) for target in contents], **facts}
    answer(json_output, found, TEXT("written", form=asked.form, out=shlex.quote(str(out)), **facts))


def _validity(found: Found, form: str) -> dict[str, Any]:
    """The ranges of the model's records, and where the speeds and places of a friction table leave them, noted."""
    left = {} if form == "fmu" else beyond(found.covered, tabled())
    if found.covered:
        note(beyond_words(left) if left else covered_words(found.covered))
    return {"validity": {name: list(ends) for name, ends in found.covered.items()}, "beyond_records": left}


def _targets(form: str, out: Path) -> list[Path]:
    if form != "table":
        return [check_file(out, "--out", (".fmu",) if form == "fmu" else (".xml",))]
    if out.exists():
        check_folder(out, "--out")
    return [out / name for name in TABLE]


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
    table = friction_table(found)
    columns = {name: TEXT(f"column.{name}") for name in table.columns}
    about = {"rig": found.rig.kind, "stage": found.stage, "columns": columns, "parameters": found.values.spelled()}
    about["not_mapped"] = table.not_mapped
    files = {out / TABLE[0]: table_text(table.columns), out / TABLE[1]: json_text(about)}
    return files, {"rows": len(table.columns["speed_m_s"]), "not_mapped": table.not_mapped}


def _mujoco(found: Found, out: Path) -> Made:
    from hil.app.export.mujoco import body

    text, numbers, missing = body(found)
    return {out: text}, {"fitted": numbers, "not_mapped": missing}
