"""A compiled function of the plant as an object file that needs no Python: the code that runs here, for elsewhere."""

from __future__ import annotations

import platform
from typing import Any, Final

import llvmlite.binding as llvm
from numba import njit, types

from plant.compiling import OPTIONS

REAL: Final = types.float64
WHOLE: Final = types.int64
VECTOR: Final = types.Array(types.float64, 1, "C")
MATRIX: Final = types.Array(types.float64, 2, "C")
_PROCESSORS: Final = {"x86_64": "x86-64-v2", "amd64": "x86-64-v2"}
"""The least processor that the code is to run on, by machine; elsewhere any."""


def object_code(function: Any, signature: tuple[Any, ...], symbol: str) -> bytes:
    """Machine code of the compiled `function` for arguments of the numba types `signature`, under the name `symbol`.

    In C it takes a pointer to its result, one to an exception (never set), and for every array numba's seven or nine
    numbers. What else it refers to is the C library's alone.
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
