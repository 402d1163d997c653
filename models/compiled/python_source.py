"""A CasADi function's instructions as Python statements."""

from __future__ import annotations

import casadi as ca

_BINARY = {
    ca.OP_ADD: "({0} + {1})",
    ca.OP_SUB: "({0} - {1})",
    ca.OP_MUL: "({0} * {1})",
    ca.OP_DIV: "({0} / {1})",
    ca.OP_POW: "({0} ** {1})",
    ca.OP_CONSTPOW: "({0} ** {1})",
    ca.OP_FMIN: "({0} if {0} < {1} else {1})",
    ca.OP_FMAX: "({0} if {0} > {1} else {1})",
    ca.OP_LT: "(1.0 if {0} < {1} else 0.0)",
    ca.OP_LE: "(1.0 if {0} <= {1} else 0.0)",
    ca.OP_EQ: "(1.0 if {0} == {1} else 0.0)",
    ca.OP_NE: "(1.0 if {0} != {1} else 0.0)",
    ca.OP_AND: "(1.0 if ({0} != 0.0 and {1} != 0.0) else 0.0)",
    ca.OP_OR: "(1.0 if ({0} != 0.0 or {1} != 0.0) else 0.0)",
    ca.OP_IF_ELSE_ZERO: "({1} if {0} != 0.0 else 0.0)",
    ca.OP_ATAN2: "math.atan2({0}, {1})",
    ca.OP_FMOD: "math.fmod({0}, {1})",
    ca.OP_COPYSIGN: "math.copysign({0}, {1})",
    ca.OP_HYPOT: "math.hypot({0}, {1})",
}
_UNARY = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "(-{0})",
    ca.OP_SQ: "({0} * {0})",
    ca.OP_TWICE: "({0} + {0})",
    ca.OP_INV: "(1.0 / {0})",
    ca.OP_FABS: "abs({0})",
    ca.OP_SIGN: "(1.0 if {0} > 0.0 else (-1.0 if {0} < 0.0 else 0.0))",
    ca.OP_NOT: "(1.0 if {0} == 0.0 else 0.0)",
    ca.OP_FLOOR: "math.floor({0})",
    ca.OP_CEIL: "math.ceil({0})",
}
_MATH = {
    getattr(ca, f"OP_{name.upper()}"): name
    for name in (
        "exp",
        "log",
        "sqrt",
        "sin",
        "cos",
        "tan",
        "tanh",
        "sinh",
        "cosh",
        "atan",
        "asin",
        "acos",
        "log1p",
        "expm1",
        "erf",
    )
}


def statements(
    step: ca.Function, names: dict[tuple[int, int], str], prefix: str
) -> tuple[list[str], dict[tuple[int, int], str]]:
    """The function's instructions as Python statements, and for each output entry (argument, entry) the variable that
    holds it.

    `names` says what each input entry is called; `prefix` begins the names of intermediate results. Raises ValueError
    for operations that are not scalar.
    """
    lines: list[str] = []
    out: dict[tuple[int, int], str] = {}
    held: dict[int, str] = {}
    for k in range(step.n_instructions()):
        op, ins, outs = step.instruction_id(k), step.instruction_input(k), step.instruction_output(k)
        if op == ca.OP_OUTPUT:
            out[(outs[0], outs[1])] = held[ins[0]]
            continue
        if op == ca.OP_CONST:
            held[outs[0]] = repr(float(step.instruction_constant(k)))
            continue
        if op == ca.OP_INPUT:
            held[outs[0]] = names[(ins[0], ins[1])]
            continue
        args = [held[i] for i in ins]
        if op in _BINARY:
            text = _BINARY[op].format(*args)
        elif op in _UNARY:
            text = _UNARY[op].format(*args)
        elif op in _MATH:
            text = f"math.{_MATH[op]}({args[0]})"
        else:
            raise ValueError(
                f"the step function must use scalar operations that compile; got CasADi operation number {op}"
            )
        lines.append(f"{prefix}{k} = {text}")
        held[outs[0]] = f"{prefix}{k}"
    return lines, out
