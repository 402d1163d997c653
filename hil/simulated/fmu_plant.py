"""An FMU, another program's model, in place of the simulated plant."""

import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np

from plant import layout as at
from plant.drives import TrueCoil, TrueDrive, TruePull, TrueVibro
from plant.rig import Truth
from plant.tables import Floats


@dataclass(frozen=True)
class Named:
    """A variable: `index` is that in the plant's state, `column` that in its rows, -1: none."""

    name: str
    unit: str
    description: str
    index: int = -1
    column: int = -1


WALL: Final = Named("wall_displacement_m", "m", "displacement of the wall", at.S_U, at.O_U)
FORCE: Final = Named("force_N", "N", "drive's force (a pull's own) in the last step", column=at.O_FORCE)
_EVERY: Final = (
    Named("position_m", "m", "capsule along the lumen", at.S_X, at.O_X),
    Named("velocity_m_s", "m/s", "capsule's speed", at.S_V, at.O_V),
    WALL,
)
_CURRENT: Final = Named("coil_current_A", "A", "coil's current", at.S_CURRENT, at.O_CURRENT)
_INNER: Final = (
    Named("inner_position_m", "m", "inner mass along the lumen", at.S_INNER_X, at.O_INNER_X),
    Named("inner_velocity_m_s", "m/s", "inner mass's speed", at.S_INNER_V, at.O_INNER_V),
)


def input_of(drive: TrueDrive) -> Named:
    if isinstance(drive, TruePull):
        return Named("pull_position_m", "m", "imposed position, reached at the end of a communication step")
    if _by_coil(drive):
        return Named("coil_voltage_V", "V", "coil's voltage, held over a communication step")
    if isinstance(drive, TrueVibro):
        return Named("drive_on", "1", "share 0..1 of the drive's force, held over a communication step")
    return Named("carriage_position_m", "m", "carriage, reached at the end of a communication step")


def outputs_of(drive: TrueDrive) -> list[Named]:
    return [*_EVERY, *([_CURRENT] if _by_coil(drive) else []), *(_INNER if isinstance(drive, TrueVibro) else [])]


def _by_coil(drive: TrueDrive) -> bool:
    return isinstance(drive, TrueCoil) or (isinstance(drive, TrueVibro) and drive.coil is not None)


UNPACKED: Final = 1 << 30  # maximum bytes of an unpacked FMU


@dataclass(frozen=True)
class FmuFile:
    description: Any
    command: int
    outputs: Mapping[int, int]


def read_fmu(path: Path, rig: Truth) -> FmuFile:
    """The FMU `path` for a plant like `rig`. Raises ValueError of one sentence if it does not fit."""
    if find_spec("fmpy") is None:
        raise ValueError("plant.fmu needs the package fmpy, which is not installed: pip install '.[fmu]'")
    import fmpy

    if not path.is_file():
        raise ValueError(f"plant.fmu must be a file; got {path}, which is not there")
    try:
        _check_archive(path)
        described = fmpy.read_model_description(str(path))
    except Exception as error:  # noqa: BLE001  zip, XML, schema: whatever FMPy meets
        raise ValueError(f"plant.fmu must be an FMU; got {path}: {str(error).splitlines()[0]}") from None
    unit, version = described.coSimulation, described.fmiVersion
    if unit is not None and not unit.modelIdentifier.isidentifier():
        raise ValueError(f"plant.fmu must name a library in itself; got {path}, {unit.modelIdentifier!r}")
    if unit is None or not version.startswith(("2.", "3.")):
        raise ValueError(f"plant.fmu must be one for Co-Simulation, FMI 2 or 3; got {path}, FMI {version}")
    command = input_of(rig.drive).name
    outputs = {v.name: v.column for v in (*outputs_of(rig.drive), FORCE)}
    wanted = [name for name in outputs if name != WALL.name]
    there = {(v.name, v.causality): v.valueReference for v in described.modelVariables}
    needed = [(command, "input"), *((name, "output") for name in wanted)]
    if missing := [one for one in needed if one not in there]:
        names, lacks = (", ".join(f"{causality} {name}" for name, causality in some) for some in (needed, missing))
        raise ValueError(f"plant.fmu must have the variables {names}; got {path} without {lacks}")
    columns = {there[name, "output"]: column for name, column in outputs.items() if (name, "output") in there}
    return FmuFile(described, there[command, "input"], columns)


def _check_archive(path: Path) -> None:
    """Refuse, before unpacking, an archive with paths outside itself or with too many bytes."""
    with zipfile.ZipFile(path) as archive:
        for part in archive.infolist():
            if part.filename.startswith("/") or ".." in PurePosixPath(part.filename).parts:
                raise ValueError(f"its part {part.filename} lies outside it")
        if sum(part.file_size for part in archive.infolist()) > UNPACKED:
            raise ValueError(f"it unpacks to more than {UNPACKED} bytes")


class FmuPlant:
    """`plant.session.Stepped` by an FMU, at first at rest at 0. Rows have its outputs; a step ends at its command."""

    def __init__(self, path: Path, rig: Truth) -> None:
        """Raises ValueError as `read_fmu`, and for an FMU that does not start."""
        import fmpy
        from fmpy.simulation import instantiate_fmu

        self.rig, self._path, self._file = rig, path, read_fmu(path, rig)
        self.state: Floats = np.zeros(at.S_COUNT)
        unpacked = tempfile.mkdtemp(prefix="capsule-fmu-")
        weakref.finalize(self, shutil.rmtree, unpacked, ignore_errors=True)
        third = self._file.description.fmiVersion.startswith("3.")
        try:
            folder = fmpy.extract(str(path), unzipdir=unpacked)
            self._unit = unit = instantiate_fmu(folder, self._file.description, "CoSimulation")
            self._set, self._get = (unit.setFloat64, unit.getFloat64) if third else (unit.setReal, unit.getReal)
            if not third:
                unit.setupExperiment(startTime=0.0)
            unit.enterInitializationMode()
            unit.exitInitializationMode()
            self._seen = self._outputs()
        except Exception as error:  # noqa: BLE001  a foreign program: whatever it does
            raise ValueError(f"plant.fmu must start; got {path}: {error}") from None

    @property
    def time(self) -> float:
        return float(self.state[at.S_STEP] * self.rig.step_s)

    def advance(self, drive: Floats, every: int = 1) -> Floats:
        """Do `len(drive) - 1` steps of the rig's length; see `Plant.advance`. Raises ValueError if the FMU fails."""
        rows, first, steps = [], int(self.state[at.S_STEP]), drive.size - 1
        stops = [0, *(k for k in range(1, steps) if (first + k) % every == 0), steps]
        for begin, end in pairwise(stops):
            if (first + begin) % every == 0:
                rows.append(self._row(float(drive[begin])))
            self._step(float(drive[end]) / self.rig.drive.command_scale, end - begin)
        return np.array(rows).reshape(-1, at.O_COUNT)

    def _step(self, command: float, steps: int) -> None:
        dt = self.rig.step_s
        try:
            self._set([self._file.command], [command])
            self._unit.doStep(self.time, steps * dt)
            self.state[at.S_STEP] += steps
            self._seen = self._outputs()
        except Exception as error:  # noqa: BLE001  a foreign program: whatever it does
            raise ValueError(f"plant.fmu must go on; got {self._path} at {self.time:g} s: {error}") from None
        if not np.isfinite(self._seen).all():
            raise ValueError(f"plant.fmu must show finite numbers; got {self._path} at {self.time:g} s")
        self.state[at.S_CURRENT] = self._row(command)[at.O_CURRENT]

    def _outputs(self) -> Floats:
        return np.array(self._get(list(self._file.outputs)))

    def _row(self, drive: float) -> Floats:
        row = np.zeros(at.O_COUNT)
        row[list(self._file.outputs.values())] = self._seen
        row[at.O_T], row[at.O_DRIVE] = self.time, drive
        return row
