"""The simulated plant of a scenario as an FMU: its own compiled loops, its numbers, nothing of Python."""

import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import llvmlite.binding as llvm
from numba import njit, types

from hil.app.export.fmu_archive import FmuUnit, Variable, c_array, c_header, reference
from hil.app.export.found import TEXT
from hil.app.scenario.scenario import BUS_TABLES, TABLES, TRUTH_TABLES
from hil.drives.makers import ACTUATORS
from hil.simulated.fmu_plant import FORCE, input_of, outputs_of
from models.files.toml import in_file, read_toml
from models.parameter import nearest
from plant import layout as at
from plant.compiling import OPTIONS
from plant.drives import TruePull
from plant.experiments.scenario import TABLES as OF_SIMULATE
from plant.experiments.scenario import RunTable, parse_truth
from plant.hidden import actuation
from plant.hidden.registry import ROW
from plant.rig import Plant, Truth
from plant.steps import advance
from plant.tables import Floats

_CORE: Final = Path(__file__).with_name("plant_core.c")
_PLACES: Final = ("S_STEP", "S_DIRECTION", "S_COUNT", "P_COUNT", "O_FORCE", "O_COUNT", "L_COUNT", "NODES")


REAL: Final = types.float64
WHOLE: Final = types.int64
VECTOR: Final = types.Array(types.float64, 1, "C")
MATRIX: Final = types.Array(types.float64, 2, "C")
_PROCESSORS: Final = {"x86_64": "x86-64-v2", "amd64": "x86-64-v2"}
"""The least processor that the code is to run on, by machine; elsewhere any."""


def plant_unit(name: str, rig: Truth, duration_s: float) -> FmuUnit:
    """The FMU of `rig` at rest at 0. Raises ValueError where its drive changes its kind when a hidden effect begins."""
    plant = Plant(rig)
    stages = plant.stages()
    kinds = {rig.drive.steps(effects) for _, effects in stages}
    if len(kinds) > 1:
        raise ValueError("effects.string_compliance must begin with the run in an FMU; got an onset at a rigid pull")
    command, shown = input_of(rig.drive), outputs_of(rig.drive)
    variables = [
        Variable(command.name, "input", command.unit, command.description),
        *(Variable(v.name, "output", v.unit, v.description) for v in (*shown, FORCE)),
    ]
    common = (VECTOR, VECTOR, MATRIX, MATRIX, VECTOR, VECTOR, REAL, WHOLE, MATRIX)
    objects = {
        "advance.o": object_code(advance, (WHOLE, *common), "capsule_advance"),
        "lags.o": object_code(actuation.lags, (VECTOR, REAL, REAL, VECTOR), "capsule_lags"),
        "play.o": object_code(actuation.rounded_play, (VECTOR, REAL, VECTOR), "capsule_play"),
    }
    header = _header(plant, stages, kinds.pop(), variables)
    return FmuUnit(name, TEXT("plant", name=name), variables, header, _CORE, rig.step_s, duration_s, 1e-3, objects)


def _header(plant: Plant, stages: list[tuple[int, Floats]], kind: int, variables: list[Variable]) -> str:
    drive, h = plant.rig.drive, stages[0][1]
    straight = drive.straight or isinstance(drive, TruePull)
    defines: dict[str, int | str] = {name: int(getattr(at, name)) for name in _PLACES} | {
        "INPUT": 1,
        "PARAMETERS_FROM": 1 + len(variables),
        "FORCE": reference(variables, FORCE.name),
        "DT": plant.rig.step_s.hex(),
        "KIND": kind,
        "STRAIGHT": int(straight),
        "SCALE": float(drive.command_scale).hex(),
        "CARRIAGE": actuation.CARRIAGE_NUMBERS,
        "LAG": ROW.actuator_lag * h.shape[1],
        "DRIVER": ROW.driver_lag * h.shape[1],
        "PLAY": ROW.carriage_backlash * h.shape[1],
        "H_ROWS": h.shape[0],
        "H_SLOTS": h.shape[1],
        "STAGES": len(stages),
        "PROFILE_COUNT": plant.profile.size,
    }
    tables = ",\n".join("{" + ", ".join(float(v).hex() for v in t.ravel()) + "}" for _, t in stages)
    return "#include <stdint.h>\n" + c_header(
        variables,
        defines,
        {v.name: v.index for v in outputs_of(drive)},
        c_array("double", "PARAMETERS", plant.parameters.tolist()),
        c_array("double", "PROFILE", plant.profile.tolist()),
        c_array("double", "TABLES", plant.tables.ravel().tolist()),
        c_array("int64_t", "BEGINS", [begin for begin, _ in stages]),
        f"static const double EFFECTS[{len(stages)}][{h.size}] = {{{tables}}};",
    )


def read_truth(path: Path) -> tuple[RunTable, Truth]:
    """How long a scenario runs, and its plant. Raises ValueError of one sentence."""
    raw, _ = read_toml(path, "scenario")
    tables = {name: table for name, table in raw.items() if name in TRUTH_TABLES}
    with in_file(path):
        for name, table in raw.items():
            if name not in (*TABLES, *BUS_TABLES, *OF_SIMULATE, *ACTUATORS):
                known = (*TABLES, *BUS_TABLES)
                raise ValueError(f"tables must be among {', '.join(known)}; got [{name}]; {nearest(name, known)}")
            if name in tables and not isinstance(table, Mapping):
                raise ValueError(f"{name} must be a table; got {table!r}")
        run, _, rig = parse_truth(tables)
        Plant(rig)
    return run, rig


def object_code(function: Any, signature: tuple[Any, ...], symbol: str) -> bytes:
    """Machine code of the compiled `function` under the name `symbol`. In C it takes a pointer to its result, one to an
    exception (never set), and for every array numba's seven or nine numbers.
    """
    fresh: Any = njit(**{**OPTIONS, "cache": False})(function.py_func)
    fresh.compile(signature)
    result = fresh.overloads[signature]
    module = llvm.parse_assembly(result.library.get_llvm_str())
    kept = module.get_function(result.fndesc.llvm_func_name)
    kept.name = symbol
    for entry in (*module.functions, *module.global_variables):
        if not entry.is_declaration and entry.name != symbol:
            entry.linkage = "internal"
    cpu = _PROCESSORS.get(platform.machine().lower(), "")
    machine = llvm.Target.from_default_triple().create_target_machine(cpu=cpu, opt=3, reloc="pic", codemodel="default")
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    return bytes(machine.emit_object(module))
