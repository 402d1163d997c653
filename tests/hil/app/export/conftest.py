"""Small scenarios and models to export, and a program that plays an FMU."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from models.effects import CATALOGUE
from models.identification.model import Model
from models.theta import Theta
from tests.rig_texts import GUT, PLATE

MAGNET = '[rig]\nkind = "magnetic"\nmagnet_stiffness_N_per_m = 25.0\nmagnet_range_m = 0.02\n'
PULL = '[rig]\nkind = "pull"\n'
SCENARIO = f"""
[scenario]
name = "small plant"
duration_s = 2.0
seed = 3
{GUT.replace('preset = "jejunum"', "")}
{MAGNET}
[reference]
kind = "ramp"
speed_mm_s = 5.0
"""
SHAKEN = f"""
[scenario]
duration_s = 2.0
{PLATE}
[rig]
kind = "vibro"
[effects.driver_lag]
time_s = 4e-3
"""
BASE = Theta({"hoop_stress_factor": 1.0, "friction_coefficient": 0.082})
FOLDS = Theta(effects={"fold_periodic": {**CATALOGUE["fold_periodic"].start(), "depth": 0.2, "wavelength_m": 7.3e-3}})
"""Values of a found model on a gut; a magnet's stiffness comes with its rig."""


@pytest.fixture
def folder_with(tmp_path: Path) -> Callable[..., Path]:
    """A folder with rig.toml and model.toml of these values in every stage."""

    def made(kind: str, rig: str, values: Theta) -> Path:
        (tmp_path / "rig.toml").write_text(GUT + rig)
        stages = dict.fromkeys(("nominal", "calibrated", "augmented"), values)
        (tmp_path / "model.toml").write_text(Model(kind, stages).to_toml())
        return tmp_path

    return made


def played(
    path: Path,
    commands: Sequence[float],
    step_s: float,
    first: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> dict[str, np.ndarray]:
    """All outputs of the FMU at the start and after each step, one of `commands` set before each."""
    fmpy = pytest.importorskip("fmpy")
    from fmpy.fmi3 import FMU3Slave

    told, folder = fmpy.read_model_description(str(path)), fmpy.extract(str(path))
    references = {v.name: v.valueReference for v in told.modelVariables if v.causality == "output"}
    settable = {v.name: v.valueReference for v in told.modelVariables if v.causality == "parameter"}
    command = next(v.valueReference for v in told.modelVariables if v.causality == "input")
    unit = FMU3Slave(
        guid=told.guid,
        unzipDirectory=folder,
        modelIdentifier=told.coSimulation.modelIdentifier,
        instanceName="played",
    )
    unit.instantiate()
    for name, value in (parameters or {}).items():
        unit.setFloat64([settable[name]], [value])
    unit.enterInitializationMode()
    unit.setFloat64([command], [first])
    unit.exitInitializationMode()
    rows = [unit.getFloat64(list(references.values()))]
    for k, value in enumerate(commands):
        unit.setFloat64([command], [float(value)])
        unit.doStep(k * step_s, step_s)
        rows.append(unit.getFloat64(list(references.values())))
    unit.terminate()
    unit.freeInstance()
    return dict(zip(references, np.array(rows).T, strict=True))
