"""A CasADi function's instructions as text, and that text as compiled code that works in one array."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import casadi as ca
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from models.compiled.arithmetic import OPERATIONS, Number

_NAMES = {value: name.removeprefix("OP_").lower() for name, value in vars(ca).items() if name.startswith("OP_")}
_INT, _REAL = ir.IntType(64), ir.DoubleType()
# LLVM would keep to 256 bits where short loops pay for wide units; these run for seconds
_WIDE = '"prefer-vector-width"="512"'


def program_of(
    function: ca.Function, names: Mapping[tuple[int, int], str], outputs: Mapping[tuple[int, int], str]
) -> str:
    """One line an instruction, `name operation argument...`, and `name set value` for each of `outputs` at the end.

    `names` says what each input entry (argument, entry) is called, `outputs` where each output entry goes. Raises
    ValueError for operations that are not scalar.
    """
    lines: list[str] = []
    ends: dict[str, str] = dict.fromkeys(outputs.values(), "0.0")
    held: dict[int, str] = {}
    for k in range(function.n_instructions()):
        op, ins, outs = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            ends[outputs[(outs[0], outs[1])]] = held[ins[0]]
        elif op == ca.OP_CONST:
            held[outs[0]] = repr(float(function.instruction_constant(k)))
        elif op == ca.OP_INPUT:
            held[outs[0]] = names[(ins[0], ins[1])]
        elif _NAMES.get(op) in OPERATIONS:
            lines.append(f"w{k} {_NAMES[op]} {' '.join(held[i] for i in ins)}")
            held[outs[0]] = f"w{k}"
        else:
            raise ValueError(
                f"the step function must use scalar operations that compile; got CasADi operation number {op}"
            )
    return "\n".join(lines + [f"{name} set {value}" for name, value in ends.items()])


def step_program(text: str, lanes: int) -> Any:
    """`text` as a function `(work, lane, a0, a1, t, h)` for compiled code; see `_code`."""
    code = _code(text, lanes, ("a0", "a1", "t", "h"))
    return intrinsic(
        lambda typing, work, lane, a0, a1, t, h: (types.void(work, types.int64, *[types.float64] * 4), code)
    )


def correction_program(text: str, lanes: int) -> Any:
    """`text` as a function `(work, lane, e, gain)` for compiled code; see `_code`."""
    code = _code(text, lanes, ("e", "gain"))
    return intrinsic(lambda typing, work, lane, e, gain: (types.void(work, types.int64, *[types.float64] * 2), code))


def _code(text: str, lanes: int, scalars: tuple[str, ...]) -> Callable[..., Any]:
    """Writes the program's operations out: a name `m3` is entry `3 lanes + lane` of `work`, read when first used and
    written at the end.

    Code that is written directly spares numba its analysis, which takes four fifths of the time to compile.
    """
    rows = [line.split() for line in text.splitlines()]

    def write(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        set.add(builder.function.attributes, _WIDE)  # llvmlite's own `add` knows no attribute with a value
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        known = {name: Number(builder, value) for name, value in zip(scalars, args[2:], strict=True)}

        def place(name: str) -> Any:
            at = builder.add(args[1], ir.Constant(_INT, int(name[1:]) * lanes))
            return builder.gep(data, [at], inbounds=True)

        def number(token: str) -> Number:
            if token not in known:
                known[token] = Number(
                    builder, builder.load(place(token)) if token[0] == "m" else ir.Constant(_REAL, float(token))
                )
            return known[token]

        ends = []
        for name, operation, *given in rows:
            if operation == "set":
                ends.append((name, number(given[0])))
            else:
                known[name] = OPERATIONS[operation](*(number(token) for token in given))
        for name, value in ends:
            builder.store(value.value, place(name))
        return context.get_dummy_value()

    return write
