"""An FMU in the place of the simulated plant: a program of somebody else's that is stepped as ours is."""

import shutil
import tempfile
import weakref
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np

from plant import layout as at
from plant.drives import TrueCoil, TrueDrive, TruePull, TrueVibro
from plant.rig import Truth
from plant.tables import Floats


@dataclass(frozen=True)
class Named:
    """A variable: `place` is where the plant's state has it, `column` where its rows do, -1 where they do not."""

    name: str
    unit: str
    description: str
    place: int = -1
    column: int = -1


WALL: Final = Named("wall_displacement_m", "m", "by which the wall is dragged", at.S_U, at.O_U)
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


UNPACKED: Final = 1 << 30  # most bytes that an FMU may unpack to


@dataclass(frozen=True)
class FmuFile:
    """What an FMU says of itself, and the value references of what a plant needs of it."""

    description: Any
    command: int
    outputs: Mapping[int, int]


def read_fmu(path: Path, rig: Truth) -> FmuFile:
    """The FMU `path` for a plant like `rig`. Raises ValueError of one sentence where it is none for it."""
    if find_spec("fmpy") is None:
        raise ValueError("plant.fmu needs the package fmpy, which is not installed: pip install '.[fmu]'")
    import fmpy

    if not path.is_file():
        raise ValueError(f"plant.fmu must be a file; got {path}, which is not there")
    try:
        _check_archive(path)
        told = fmpy.read_model_description(str(path))
    except Exception as error:  # noqa: BLE001  zip, XML, schema: whatever FMPy meets
        raise ValueError(f"plant.fmu must be an FMU; got {path}: {str(error).splitlines()[0]}") from None
    if told.coSimulation is not None and not told.coSimulation.modelIdentifier.isidentifier():
        raise ValueError(f"plant.fmu must name a library in itself; got {path}, {told.coSimulation.modelIdentifier!r}")
    if told.coSimulation is None or not told.fmiVersion.startswith(("2.", "3.")):
        raise ValueError(f"plant.fmu must be one for Co-Simulation, FMI 2 or 3; got {path}, FMI {told.fmiVersion}")
    command = input_of(rig.drive).name
    outputs = {v.name: v.column for v in (*outputs_of(rig.drive), FORCE)}
    wanted = [name for name in outputs if name != WALL.name]
    there = {(v.name, v.causality): v.valueReference for v in told.modelVariables}
    missing = [f"input {command}"] if (command, "input") not in there else []
    missing += [f"output {name}" for name in wanted if (name, "output") not in there]
    if missing:
        needed = ", ".join([f"input {command}", *(f"output {name}" for name in wanted)])
        raise ValueError(f"plant.fmu must have the variables {needed}; got {path} without {', '.join(missing)}")
    columns = {there[name, "output"]: column for name, column in outputs.items() if (name, "output") in there}
    return FmuFile(told, there[command, "input"], columns)


def _check_archive(path: Path) -> None:
    """Refuse, before anything is unpacked, an archive with places outside itself or with more than a program is."""
    with zipfile.ZipFile(path) as archive:
        for part in archive.infolist():
            if part.filename.startswith("/") or ".." in PurePosixPath(part.filename).parts:
                raise ValueError(f"its part {part.filename} lies outside it")
        if sum(part.file_size for part in archive.infolist()) > UNPACKED:
            raise ValueError(f"it unpacks to more than {UNPACKED} bytes")


class FmuPlant:
    """`plant.session.Stepped` by an FMU at rest at 0: rows have its outputs, steps the drive's command at their end."""

    def __init__(self, path: Path, rig: Truth) -> None:
        """Raises ValueError as `read_fmu`, and for one that does not start."""
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
        """Do `len(drive) - 1` steps of the rig's length; see `Plant.advance`. Raises ValueError where the FMU fails."""
        rows, first, steps = [], int(self.state[at.S_STEP]), drive.size - 1
        stops = [*(k for k in range(1, steps) if (first + k) % every == 0), steps]
        at_step = 0
        for stop in stops:
            if (first + at_step) % every == 0:
                rows.append(self._row(float(drive[at_step])))
            self._step(float(drive[stop]) / self.rig.drive.command_scale, stop - at_step)
            at_step = stop
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
