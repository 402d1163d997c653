"""CasADi functions as machine code on one array, kept on disk."""

import hashlib
import marshal
import os
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target
from numba.extending import intrinsic

from models.compiled.arithmetic import OPERATIONS, Number
from models.files.access import cache_folder, draft

_NAMES = {value: name.removeprefix("OP_").lower() for name, value in vars(ca).items() if name.startswith("OP_")}
_INT, _REAL = ir.IntType(64), ir.DoubleType()
_KIND = ir.FunctionType(ir.VoidType(), [_REAL.as_pointer(), _REAL.as_pointer()])
# LLVM would keep to 256 bits where short loops pay for wide units; these run for seconds
_WIDE = '"prefer-vector-width"="512"'
_WRITERS = (Path(__file__), *(Path(__file__).with_name(f"arithmetic.{ending}") for ending in ("py", "toml")))
_LOADING = threading.Lock()
_LOADED: dict[str, Any] = {}


@dataclass(frozen=True)
class Code:
    """A function of scalar operations: argument `k` begins at entry `inputs[k]` of `work`, output `k` at `outputs[k]`;
    other arguments are scalars, in their order in `shared`.
    """

    function: ca.Function
    inputs: Mapping[int, int]
    outputs: Sequence[int]


def _call(typing: Any, address: Any, work: Any, shared: Any) -> Any:
    def write(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        arrays = zip(signature.args[1:], args[1:], strict=True)
        data = [context.make_array(kind)(context, builder, value).data for kind, value in arrays]
        builder.call(builder.inttoptr(args[0], _KIND.as_pointer()), data)
        return context.get_dummy_value()

    return types.void(types.int64, work, shared), write


call: Any = intrinsic(_call)
"""`call(address, work, shared)` runs the machine code at `address` on two arrays; for compiled code."""


def addresses(codes: Sequence[Code], lanes: int = 1) -> tuple[int, ...]:
    """Addresses of the machine code `(work, shared)` of `codes`, for `lanes` sets of numbers side by side: entry `k` of
    set `lane` is `work[k lanes + lane]`. Compiled once, kept on disk; ValueError for operations that are not scalar.
    """
    codegen = cpu_target.target_context.codegen()
    text = repr([(c.function.serialize(), dict(c.inputs), list(c.outputs)) for c in codes])
    key = hashlib.sha256(repr((lanes, codegen.magic_tuple(), text)).encode())
    for path in _WRITERS:
        key.update(path.read_bytes())
    name = "capsule_" + key.hexdigest()[:20]
    with _LOADING:
        if name not in _LOADED:
            _LOADED[name] = _library(codegen, name, codes, lanes)
        return tuple(_LOADED[name].get_pointer_to_function(f"{name}_{k}") for k in range(len(codes)))


@global_compiler_lock
def _library(codegen: Any, name: str, codes: Sequence[Code], lanes: int) -> Any:
    path = cache_folder() / f"{name}.bin"
    try:
        return codegen.unserialize_library(marshal.loads(path.read_bytes()))
    except (FileNotFoundError, EOFError, ValueError, TypeError):  # not there yet, or cut short
        pass
    library = codegen.create_library(name)
    library.enable_object_caching()
    module = library.create_ir_module(name)
    for k, code in enumerate(codes):
        _write(ir.Function(module, _KIND, f"{name}_{k}"), code, lanes)
    library.add_ir_module(module)
    library.finalize()
    os.replace(draft(path, marshal.dumps(library.serialize_using_object_code())), path)
    return library


def _write(function: Any, code: Code, lanes: int) -> None:
    """Loop over the lanes; entries of `work` are read when first used, results written at the end."""
    set.add(function.attributes, _WIDE)  # llvmlite's own `add` knows no attribute with a value
    work, shared = function.args
    for argument in function.args:
        argument.add_attribute("noalias")
    builder = ir.IRBuilder(function.append_basic_block())
    scalars = [k for k in range(code.function.n_in()) if k not in code.inputs]
    with cgutils.for_range(builder, ir.Constant(_INT, lanes)) as loop:

        def entry_of(entry: int) -> Any:
            return builder.gep(work, [builder.add(loop.index, ir.Constant(_INT, entry * lanes))], inbounds=True)

        def given(argument: int, entry: int) -> Number:
            if argument in code.inputs:
                at = entry_of(code.inputs[argument] + entry)
            else:
                at = builder.gep(shared, [ir.Constant(_INT, scalars.index(argument))], inbounds=True)
            return Number(builder, builder.load(at))

        for entry, value in _results(code.function, given, lambda x: Number(builder, ir.Constant(_REAL, x))):
            builder.store(value.value, entry_of(code.outputs[entry[0]] + entry[1]))
    builder.ret_void()


def _results(function: ca.Function, given: Any, constant: Any) -> list[tuple[tuple[int, int], Number]]:
    """The function's operations written out, and the value of each output entry (argument, entry)."""
    ends = {(k, i): constant(0.0) for k in range(function.n_out()) for i in range(function.numel_out(k))}
    values: dict[int, Number] = {}
    read: dict[tuple[int, int], Number] = {}
    for k in range(function.n_instructions()):
        op, ins, outs = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if op == ca.OP_OUTPUT:
            ends[(outs[0], outs[1])] = values[ins[0]]
        elif op == ca.OP_CONST:
            values[outs[0]] = constant(float(function.instruction_constant(k)))
        elif op == ca.OP_INPUT:
            entry = (ins[0], ins[1])
            if entry not in read:
                read[entry] = given(*entry)
            values[outs[0]] = read[entry]
        elif _NAMES.get(op) in OPERATIONS:
            values[outs[0]] = OPERATIONS[_NAMES[op]](*(values[i] for i in ins))
        else:
            raise ValueError(f"step must use scalar operations that compile; got CasADi operation number {op}")
    return list(ends.items())
