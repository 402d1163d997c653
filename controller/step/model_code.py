"""The control model in C: CasADi's functions of scalar operations written out as straight-line code."""

from collections.abc import Mapping, Sequence
from typing import Final

import casadi as ca

from controller.drives import Numbers
from controller.limits import Envelope
from controller.model.control_model import ControlModel
from models.theta import bare

_NAMES: Final = {value: name.removeprefix("OP_").lower() for name, value in vars(ca).items() if name.startswith("OP_")}
_LONGEST_PRODUCT: Final = 16  # largest power that is written as a product
_CALLED: Final = (
    *("exp", "expm1", "sinh", "cosh", "tanh", "log", "log1p", "sin", "cos", "sqrt", "floor", "ceil", "copysign"),
    *("tan", "atan", "asin", "acos", "erf", "atan2", "fmod", "hypot", "sign"),
)
_WRITTEN: Final = {
    "add": "{0} + {1}",
    "sub": "{0} - {1}",
    "mul": "{0} * {1}",
    "div": "{0} / {1}",
    "fmin": "{0} < {1} ? {0} : {1}",
    "fmax": "{0} > {1} ? {0} : {1}",
    "lt": "{0} < {1} ? R(1) : R(0)",
    "le": "{0} <= {1} ? R(1) : R(0)",
    "eq": "{0} == {1} ? R(1) : R(0)",
    "ne": "{0} != {1} ? R(1) : R(0)",
    "and": "(({0} != R(0)) & ({1} != R(0))) != 0 ? R(1) : R(0)",
    "or": "(({0} != R(0)) | ({1} != R(0))) != 0 ? R(1) : R(0)",
    "not": "{0} == R(0) ? R(1) : R(0)",
    "if_else_zero": "{0} != R(0) ? {1} : R(0)",
    "assign": "{0}",
    "neg": "-{0}",
    "sq": "{0} * {0}",
    "twice": "{0} + {0}",
    "inv": "R(1) / {0}",
    "fabs": "real_abs({0})",
    **{name: f"real_{name}({{0}})" for name in _CALLED},
    **{name: f"real_{name}({{0}}, {{1}})" for name in ("copysign", "atan2", "fmod", "hypot")},
}


def literal(value: float) -> str:
    """`value` as a C constant."""
    if value != value:
        return "R(NAN)"
    return f"R({value!r})" if abs(value) < float("inf") else ("R(INFINITY)" if value > 0 else "R(-INFINITY)")


def _power(x: str, y: str, constant: float | None) -> str:
    """A power with a whole constant exponent is a product."""
    if constant is None or not constant.is_integer() or not 1 <= abs(constant) <= _LONGEST_PRODUCT:
        return f"real_power({x}, {y})"
    product = " * ".join([x] * round(abs(constant)))
    return product if constant > 0 else f"R(1) / ({product})"


def statements(function: ca.Function, inputs: Sequence[str], outputs: Sequence[str]) -> tuple[list[str], list[str]]:
    """The operations of `function` as statements: first those that are the same in every turn of a loop over k, then
    the others, the results last. `inputs` and `outputs` are templates of C expressions, one an argument and one a
    result, `{}` the entry; one with `[k]` differs from turn to turn. Raises ValueError for operations that are not
    scalar.
    """
    shared, own, last, differs = list[str](), list[str](), list[str](), set[str]()
    value, constants, read = dict[int, str](), dict[str, float](), dict[tuple[int, int], str]()
    for k in range(function.n_instructions()):
        op, ins, outs = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        name = _NAMES.get(op, "")
        if op == ca.OP_OUTPUT:
            last.append(f"{outputs[outs[0]].format(outs[1])} = {value[ins[0]]};")
            continue
        if op == ca.OP_CONST:
            value[outs[0]] = literal(float(function.instruction_constant(k)))
            constants[value[outs[0]]] = float(function.instruction_constant(k))
            continue
        if op == ca.OP_INPUT:
            entry = (ins[0], ins[1])
            if entry in read:
                value[outs[0]] = read[entry]
                continue
            text = inputs[ins[0]].format(ins[1])
            varies, read[entry] = "[k]" in text, f"a{k}"
        else:
            text = _operation(name, [value[i] for i in ins], constants, op)
            varies = any(value[i] in differs for i in ins)
        value[outs[0]] = f"a{k}"
        if varies:
            differs.add(f"a{k}")
        (own if varies else shared).append(f"const real a{k} = {text};")
    return shared, own + last


def _operation(name: str, values: Sequence[str], constants: Mapping[str, float], op: int) -> str:
    if name in ("pow", "constpow"):
        return _power(values[0], values[1], constants.get(values[1]))
    if name not in _WRITTEN:
        raise ValueError(f"model must use scalar operations to be written in C; got CasADi operation {name or op}")
    return _WRITTEN[name].format(*values)


def _plain(function: ca.Function, inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """The operations outside of any loop."""
    return "\n".join(f"    {line}" for part in statements(function, inputs, outputs) for line in part)


def _function(head: str, unused: Sequence[str], *bodies: str) -> str:
    marks = [f"    (void){name};" for name in unused]
    return "\n".join([head, "{", *bodies[:1], *marks, *bodies[1:], "}", ""])


_MOTION: Final = "real c0, real c1, real d, real t, real h, const real *q"
_NAMED: Final = ("c0", "c1", "d", "t", "h", "q")
_Q: Final = "q[{}]"


def _step(name: str, substep: ca.Function) -> str:
    body = _plain(substep, ["x[{}]", "c0", "c1", "d", "t", "h", _Q], ["x[{}]"])
    return _function(f"void {name}(real *x, {_MOTION})", _NAMED, body)


def _looped(model: ControlModel, varied: Sequence[int]) -> str:
    """The step of all particles, each with its own disturbance and parameters `varied`."""
    substep, own = model.symbols.substep, {index: f"own[{k}][k]" for k, index in enumerate(varied)}
    x, c0, c1, d, t, h = (substep.sx_in(i) for i in range(6))
    q = [ca.SX.sym("q") for _ in range(substep.numel_in(6))]
    split = ca.Function("split", [x, c0, c1, d, t, h, *q], [substep(x, c0, c1, d, t, h, ca.vertcat(*q))])
    parameters = [own.get(i, f"q[{i}]") for i in range(len(q))]
    head = (
        "void capsule_particles(real (*restrict x)[CAPSULE_PARTICLES], const real *restrict d,\n"
        "                       real (*restrict own)[CAPSULE_PARTICLES], const real *restrict q,\n"
        "                       real c0, real c1, real t, real h)"
    )
    inputs = ["x[{}][k]", "c0", "c1", "d[k]", "t", "h", *parameters]
    return _loop(head, ("own", "c0", "c1", "t", "h", "q"), "PARTICLES", statements(split, inputs, ["x[{}][k]"]))


def _loop(head: str, unused: Sequence[str], count: str, parts: tuple[list[str], list[str]]) -> str:
    """A function with the statements of `parts` before and in a loop over k."""
    shared, own = (
        "\n".join(f"{indent}{line}" for line in part) for indent, part in zip(("    ", " " * 8), parts, strict=True)
    )
    marks = "".join(f"    (void){name};\n" for name in unused)
    return (
        f"{head}\n{{\n{shared}\n    int k;\n{marks}    CAPSULE_LANES\n"
        f"    for (k = 0; k < CAPSULE_{count}; k++) {{\n{own}\n    }}\n}}\n"
    )


def _sensor(model: ControlModel) -> str:
    """The localisation's reading of all particles, where it is not the position."""
    x, t = ca.SX.sym("x", len(model.states)), ca.SX.sym("t")
    q = ca.SX.sym("q", len(model.symbols.parameters))
    shown = ca.Function("shown", [x, t, q], [model.symbols.measured(x, t, q)])
    head = (
        "void capsule_shown(real (*restrict x)[CAPSULE_PARTICLES], real t, const real *restrict q,\n"
        "                   real *restrict shown)"
    )
    return _loop(head, ("t", "q"), "PARTICLES", statements(shown, ["x[{}][k]", "t", _Q], ["shown[k]"]))


def _drive(model: ControlModel, envelope: Envelope) -> str:
    """The drive's static force and, without a gap, the command for a force."""
    names = [p.key for p in model.symbols.parameters]
    q = ca.SX.sym("q", len(names))
    numbers: Numbers = {name: q[i] for i, name in enumerate(names) if isinstance(name, str)}  # type: ignore[misc]
    one, x, v = (ca.SX.sym(name) for name in ("one", "x", "v"))
    command = one
    if getattr(model.drive, "by_voltage", False):
        command = (one - numbers["back_emf_V_s_per_m"] * v) / numbers["coil_resistance_ohm"]
    force = ca.Function("force", [one, x, v, q], [ca.densify(ca.SX(model.drive.force(x, v, command, numbers)))])
    wanted = one if envelope.placed else model.drive.command_for(one, x, v, numbers)
    inverse = ca.Function("inverse", [one, x, v, q], [ca.densify(ca.SX(wanted))])
    text = ""
    for name, function in (("capsule_drive_force", force), ("capsule_drive_command", inverse)):
        body = _plain(function, ["one", "x", "v", _Q], ["const real found"])
        head = f"real {name}(real one, real x, real v, const real *q)"
        text += _function(head, ("one", "x", "v", "q"), body, "    return found;") + "\n"
    return text


def _planning(model: ControlModel) -> str:
    """The planner's functions: a step, the slopes of all stages side by side, the inverse, the wall's force."""
    s = model.symbols
    inputs = ["x[{}][k]", "c0[k]", "c1[k]", "d", "t[k]", "h", _Q]
    head = (
        "void capsule_plan_slopes(real (*restrict x)[CAPSULE_STAGES], const real *restrict c0,\n"
        "                         const real *restrict c1, real d, const real *restrict t, real h,\n"
        "                         const real *restrict q, real (*restrict J)[CAPSULE_STAGES])"
    )
    slopes = _loop(head, ("d", "t", "h", "q"), "STAGES", statements(s.slopes, inputs, ["x[{}][k]", "J[{}][k]"]))
    text = _step("capsule_plan_step", s.substep) + f"\n{slopes}\n"
    pursuit = _plain(s.pursuit, ["x[{}]", "speed", "d", "t", _Q], ["const real found"])
    text += _function(
        "real capsule_plan_pursuit(const real *x, real speed, real d, real t, const real *q)",
        ("speed", "d", "t", "q"),
        pursuit,
        "    return found;",
    )
    head = (
        "void capsule_plan_walls(real (*restrict x)[CAPSULE_STAGES + 1], const real *restrict t,\n"
        "                        const real *restrict q, real *restrict forces,\n"
        "                        real (*restrict slopes)[CAPSULE_STAGES + 1])"
    )
    walls = statements(s.wall_slopes, ["x[{}][k]", "t[k]", _Q], ["forces[k]", "slopes[{}][k]"])
    return text + "\n" + _loop(head, ("t", "q"), "STAGES + 1", walls)


def model_code(model: ControlModel, envelope: Envelope, varied: Sequence[int], planned: bool) -> str:
    """The C source of `model`'s functions (`model.h`): the sharp one's for estimation and inversion, with the
    parameters `varied` per particle, and, if `planned`, those of the MPC.
    """
    sharp = model.sharp
    wall = _plain(sharp.symbols.wall_force, ["x[{}]", "t", _Q], ["const real found"])
    parts = [
        f"/* Generated from the control model of a {model.drive.name} drive; states:"
        f" {', '.join(str(bare(name)) for name in model.states)}. */",
        '#include "model.h"\n',
        _looped(sharp, varied),
        "" if sharp.placed else _sensor(sharp),
        _step("capsule_sharp_step", sharp.symbols.substep),
        _function(
            "real capsule_sharp_wall(const real *x, real t, const real *q)", ("x", "t", "q"), wall, "    return found;"
        ),
        "" if envelope.shaken else _drive(model, envelope),
        _planning(model) if planned else "",
    ]
    return "\n".join(part for part in parts if part)
