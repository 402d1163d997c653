"""A found model as an FMU: its step written out in C by CasADi, its parameters FMI parameters."""

from pathlib import Path
from typing import Final

import casadi as ca

from hil.app.export.fmu_archive import FmuUnit, Variable, c_array, reference, start_values
from hil.app.export.found import Found
from models.assembly.model import Assembly, followed_by
from models.files.units import unit_at_end
from models.identification.kinds.series.drive_input import internal_step
from models.theta import spelled

_CORE: Final = Path(__file__).with_name("model_core.c")
_STATES: Final = {
    "x": ("capsule_position_m", "m", "capsule along the lumen"),
    "v": ("velocity_m_s", "m/s", "capsule's speed"),
    "u": ("wall_displacement_m", "m", "by which the wall is dragged"),
}


def model_unit(name: str, found: Found) -> FmuUnit:
    """The FMU of a found model, at rest; a magnet's capsule below its magnet, a pull's where the pull begins."""
    assembly, drive = found.assembled(), found.drive
    values = found.numbers
    shown = {state: told for state, told in _STATES.items() if state != "u" or found.surface.dragged}
    way = "held over" if drive.held else "reached at the end of"
    variables = [
        Variable(drive.commanded, "input", _unit(drive.commanded), f"command, {way} a communication step"),
        Variable(drive.measured, "output", _unit(drive.measured), "what the rig measures, as predicted"),
        *(Variable(n, "output", unit, why) for n, unit, why in shown.values()),
        *(
            Variable(spelled(p.key), "parameter", p.unit or "1", p.source or spelled(p.key), values[p.key])
            for p in assembly.parameters
        ),
    ]
    step = internal_step(drive, drive.imposed and "string_compliance" not in {e.id for e in found.effects})
    header = _header(found, assembly, variables, {s: told[0] for s, told in shown.items()}, step)
    about = f"{found.stage} model of a {found.rig.kind} rig, found by capsule close-loop"
    return FmuUnit(name, about, variables, header, _CORE, step, 20.0, 2e-3)


def _unit(column: str) -> str:
    return unit_at_end(column)[1] or "1"


def _header(found: Found, assembly: Assembly, variables: list[Variable], shown: dict[str, str], step: float) -> str:
    function, drive = assembly.step, found.drive
    generator = ca.CodeGenerator("step.c")
    generator.add(function)
    parameters = [spelled(p.key) for p in assembly.parameters]
    follows = [
        followed_by(assembly.effects, name) == "command" or (k == 0 and drive.anchored)
        for k, name in enumerate(assembly.states)
    ]
    pairs = ", ".join(f"{{{reference(variables, n)}, {assembly.states.index(s)}}}" for s, n in shown.items())
    defines = {
        "VARIABLES": 1 + len(variables),
        "INPUT": 1,
        "OUTPUT": 2,
        "PARAMETERS_FROM": 1 + len(variables) - len(parameters),
        "STATES": len(assembly.states),
        "STEP_S": step.hex(),
        "HELD": int(drive.held),
        "ARGUMENTS": max(int(function.sz_arg()), 1),
        "RESULTS": max(int(function.sz_res()), 1),
        "WORK": max(int(function.sz_w()), 1),
        "IWORK": max(int(function.sz_iw()), 1),
    }
    return "\n".join(
        [
            "#define CASADI_SYMBOL_EXPORT static",
            *(f"#define {name} {value}" for name, value in defines.items()),
            f"static const int OUTPUTS[][2] = {{{pairs}}};",
            c_array("double", "START", start_values(variables)),
            c_array("double", "INITIAL", [assembly.initial[name] for name in assembly.states]),
            c_array("int", "FOLLOWS", [float(f) for f in follows]),
            str(generator.dump()),
        ]
    )
