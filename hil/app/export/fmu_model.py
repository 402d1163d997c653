"""A found model as an FMU: its step written out in C by CasADi, its parameters FMI parameters."""

from pathlib import Path
from typing import Final

import casadi as ca

from hil.app.export.fmu_archive import FmuUnit, Variable, c_array, c_header
from hil.app.export.found import TEXT, Found
from models.assembly.model import Assembly, followed_by
from models.files.units import unit_at_end
from models.identification.kinds.series.drive_input import internal_step
from models.theta import spelled

_CORE: Final = Path(__file__).with_name("model_core.c")
_STATES: Final = {"x": "capsule_position_m", "v": "velocity_m_s", "u": "wall_displacement_m"}


def model_unit(name: str, found: Found) -> FmuUnit:
    """The FMU of a found model, at rest; a magnet's capsule below its magnet, a pull's where the pull begins, an axis
    where and as fast as its parameters say.
    """
    assembly, drive = found.assembled(), found.drive
    values = found.numbers
    shown = {name: state for state, name in _STATES.items() if state != "u" or found.surface.dragged}
    starts: dict[str, str] = {}
    if drive.launched:
        speed = f"velocity_{unit_at_end(drive.measured)[1]}_s"
        shown, starts = {speed: "v"}, {f"start_{drive.measured}": "x", f"start_{speed}": "v"}
    command = TEXT("command", held=TEXT("held" if drive.stepped else "reached"))
    variables = [
        Variable(drive.commanded, "input", _unit(drive.commanded), command),
        Variable(drive.measured, "output", _unit(drive.measured), TEXT("measured")),
        *(Variable(name, "output", _unit(name), TEXT(f"state.{state}")) for name, state in shown.items()),
        *(Variable(name, "parameter", _unit(name), TEXT(f"start.{state}")) for name, state in starts.items()),
        *(
            Variable(spelled(p.key), "parameter", p.unit or "1", p.source or spelled(p.key), values[p.key])
            for p in assembly.parameters
        ),
    ]
    step = internal_step(drive, drive.imposed and "string_compliance" not in {e.id for e in found.effects})
    about = TEXT("model", stage=found.stage, kind=found.rig.kind)
    return FmuUnit(name, about, variables, _header(found, assembly, variables, shown, step), _CORE, step, 20.0, 2e-3)


def _unit(column: str) -> str:
    return unit_at_end(column)[1] or "1"


def _header(found: Found, assembly: Assembly, variables: list[Variable], shown: dict[str, str], step: float) -> str:
    function, drive = assembly.step, found.drive
    settable = sum(variable.causality == "parameter" for variable in variables)
    generator = ca.CodeGenerator("step.c")
    generator.add(function)
    follows = [
        followed_by(assembly.effects, name) == "command" or (k == 0 and drive.anchored)
        for k, name in enumerate(assembly.states)
    ]
    defines: dict[str, int | str] = {
        "CASADI_SYMBOL_EXPORT": "static",
        "INPUT": 1,
        "OUTPUT": 2,
        "PARAMETERS_FROM": 1 + len(variables) - settable,
        "STARTS": settable - len(assembly.parameters),
        "STATES": len(assembly.states),
        "STEP_S": step.hex(),
        "HELD": int(drive.stepped),
        "OFF_BEFORE": int(drive.held),
        "ARGUMENTS": max(int(function.sz_arg()), 1),
        "RESULTS": max(int(function.sz_res()), 1),
        "WORK": max(int(function.sz_w()), 1),
        "IWORK": max(int(function.sz_iw()), 1),
    }
    return c_header(
        variables,
        defines,
        {name: assembly.states.index(state) for name, state in shown.items()},
        c_array("double", "INITIAL", [assembly.initial[name] for name in assembly.states]),
        c_array("int", "FOLLOWS", [float(f) for f in follows]),
        str(generator.dump()),
    )
