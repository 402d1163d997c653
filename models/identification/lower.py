"""A CasADi step function as a compiled NumPy loop: one declaration of the model, run at the speed of machine code."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kernel = Callable[[Array, Array, Array, float, Array, int, float, Array], None]

SLOW_S = 2.0
_LOADING = threading.Lock()
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

_FRAME = '''"""Generated from a CasADi function."""

import math

import numba
import numpy as np


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={{"contract", "afn", "nsz"}})
def run(state, commands, measured, gain, parameters, substeps, dt, output):
    h = dt / substeps
    slow = 0.0
{unpack_state}
{unpack_parameters}
    for k in range(commands.shape[0]):
        c1 = commands[k]
        c0 = commands[k - 1] if k > 0 else c1
        e = 0.0
        for j in range(substeps if k > 0 else 1):
            a0 = c0 + (c1 - c0) * (j / substeps)
            a1 = c0 + (c1 - c0) * ((j + 1) / substeps)
            t = (k - 1) * dt + j * h if k > 0 else -h
{body}
{assign}
            if k == 0 or j + 1 == substeps:
                output[k] = {output}
                e = measured[k] - output[k]
        slow += min(dt / {forgets}, 1.0) * (e - slow)
        e -= slow
        if gain != 0.0:
{correct}
{pack_state}
'''


def cache_folder() -> Path:
    """Where generated code is kept: `CAPSULE_CACHE`, else the user's cache folder, else the one for temporary files."""
    root = os.environ.get("CAPSULE_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache")), "capsule"
    )
    folder = Path(root)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.gettempdir())


def statements(step: ca.Function, names: dict[tuple[int, int], str], prefix: str) -> tuple[list[str], dict[tuple[int, int], str]]:
    """The function's instructions as Python statements, and for each output entry (argument, entry) the variable that holds it.

    `names` says what each input entry is called; `prefix` begins the names of intermediate results. Raises ValueError for operations
    that are not scalar.
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
            raise ValueError(f"the step function must use scalar operations that compile; got CasADi operation number {op}")
        lines.append(f"{prefix}{k} = {text}")
        held[outs[0]] = f"{prefix}{k}"
    return lines, out


def lower(step: ca.Function, correct: ca.Function) -> Kernel:
    """Compile `step(state, c0, c1, t, h, parameters) -> (state, output)` into a loop over samples, with `correct(state, error, gain)`.

    The loop `run(state, commands, measured, gain, parameters, substeps, dt, output)` steps through `commands` (one value a sample, linear
    in between, `substeps` steps a sample of `dt` s), overwrites `state` with the last one and fills `output`, one value a sample,
    predicted before the sample is seen. `correct` then moves the state by `gain` times the prediction's error less its slow part (a mean
    over about `SLOW_S`): an observer that keeps teeth in step and leaves alone what a model lacks slowly; a gain of 0 runs free and never
    looks at `measured`. Compiled code is kept on disk under the hash of its source. Raises ValueError for operations that are not scalar.
    """
    n, m = step.numel_in(0), step.numel_in(5)
    names = {(0, i): f"s{i}" for i in range(n)} | {(5, i): f"p{i}" for i in range(m)}
    names |= {(1, 0): "a0", (2, 0): "a1", (3, 0): "t", (4, 0): "h"}
    lines, out = statements(step, names, "w")
    fixes, fixed = statements(correct, {(0, i): f"s{i}" for i in range(n)} | {(1, 0): "e", (2, 0): "gain"}, "y")
    source = _FRAME.format(
        forgets=SLOW_S,
        unpack_state="\n".join(f"    s{i} = state[{i}]" for i in range(n)),
        unpack_parameters="\n".join(f"    p{i} = parameters[{i}]" for i in range(m)),
        body="\n".join(" " * 12 + line for line in lines),
        output=out.get((1, 0), "0.0"),
        assign="\n".join(f"{' ' * 12}n{i} = {out.get((0, i), '0.0')}" for i in range(n))
        + "\n"
        + "\n".join(f"{' ' * 12}s{i} = n{i}" for i in range(n)),
        correct="\n".join(
            [" " * 12 + line for line in fixes] + [f"{' ' * 12}s{i} = {fixed.get((0, i), '0.0')}" for i in range(n)]
        ),
        pack_state="\n".join(f"    state[{i}] = s{i}" for i in range(n)),
    )
    return load(source).run  # type: ignore[no-any-return]


def load(source: str) -> Any:
    """Generated `source` as a module, kept on disk under its hash beside what numba compiles of it."""
    with _LOADING:
        return _loaded(source)


def _loaded(source: str) -> Any:
    name = "capsule_step_" + hashlib.sha256((source + sys.version).encode()).hexdigest()[:20]
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if not path.is_file():
        draft = path.with_suffix(f".{os.getpid()}")
        draft.write_text(source, encoding="utf-8")
        os.replace(draft, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
