"""The control model's step by a C compiler, where there is one: the same loops as numba's, ready in less than a
second.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from controller.model.symbols import Symbols
from models.compiled.cache import cache_folder

Array = NDArray[np.float64]

_FRAME = Path(__file__).with_name("stages.c")
_FLAGS = ("-O2", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared")
_LONGEST_S = 60.0
_VARIABLE = "CAPSULE_COMPILER"


def compiler() -> str | None:
    """The C compiler that would be used, the first of `CAPSULE_COMPILER`, cc, gcc, clang; None where there is none or
    it says `none`.
    """
    wanted = os.environ.get(_VARIABLE, "")
    if wanted == "none":
        return None
    return next((found for name in (wanted, "cc", "gcc", "clang") if name and (found := shutil.which(name))), None)


def native_functions(symbols: Symbols) -> dict[str, Callable[..., None]] | None:
    """`run`, `run_each`, `roll`, `linearise`, `pursue`, `holds` as `prediction_compiled.Kernels` has them; None without
    a compiler that works.
    """
    tool = compiler()
    if tool is None:
        return None
    source = _source(symbols)
    digest = hashlib.sha256(
        "\0".join((source, tool, platform.machine(), platform.node(), *_FLAGS)).encode()
    ).hexdigest()[:20]
    path = cache_folder() / f"capsule_stage_{digest}.so"
    try:
        if not path.is_file():
            _build(tool, source, path)
        return _called(ctypes.PyDLL(str(path)))
    except (OSError, subprocess.SubprocessError, AttributeError):
        return None


def _source(symbols: Symbols) -> str:
    functions = (symbols.substep, symbols.slopes, symbols.wall_slopes, symbols.pursuit)
    generator = ca.CodeGenerator("stage.c")
    for function in functions:
        generator.add(function)
    sizes = {
        "STATES": len(symbols.states),
        "PARAMETERS": len(symbols.parameters),
        "WORK": max(1, *(f.sz_w() for f in functions)),
    }
    return (
        str(generator.dump())
        + "".join(f"#define {name} {size}\n" for name, size in sizes.items())
        + _FRAME.read_text(encoding="utf-8")
    )


def _build(tool: str, source: str, path: Path) -> None:
    with TemporaryDirectory(dir=path.parent) as folder:
        text, draft = Path(folder) / "stage.c", Path(folder) / "stage.so"
        text.write_text(source, encoding="utf-8")
        command = [tool, *_FLAGS, "-o", str(draft), str(text), "-lm"]
        subprocess.run(command, check=True, capture_output=True, timeout=_LONGEST_S)
        os.replace(draft, path)


_begin: Any = (ctypes.c_char * 0).from_buffer  # refuses an array that is not contiguous and writable
_at: Callable[[Array], Any] = _begin


def _called(library: Any) -> dict[str, Callable[..., None]]:
    """The library's functions under numba's signatures; arrays must be C-contiguous, writable float64."""
    array, real, whole = ctypes.c_void_p, ctypes.c_double, ctypes.c_longlong
    run_c, roll_c, linearise_c, run_each_c = library.run, library.roll, library.linearise, library.run_each
    pursue_c, holds_c = library.pursue, library.holds
    run_c.argtypes = [array, whole, real, real, array, real, real, whole, array]
    run_each_c.argtypes = [*run_c.argtypes, whole, array]
    roll_c.argtypes = [array, array, whole, real, real, real, whole, array]
    linearise_c.argtypes = [array, array, array, array, whole, real, real, real, whole, array]
    pursue_c.argtypes = [array, array, array, array, whole, *[real] * 7, whole, array]
    holds_c.argtypes = [array, array, array, whole, real, real, array]
    for function in (run_c, run_each_c, roll_c, linearise_c, pursue_c, holds_c):
        function.restype = None

    def run(
        states: Array, command: float, after: float, d: Array, t: float, tick: float, substeps: int, p: Array
    ) -> None:
        run_c(_at(states), len(states), command, after, _at(d), t, tick, substeps, _at(p))

    def run_each(
        states: Array, command: float, after: float, d: Array, t: float, tick: float, substeps: int, *own: Any
    ) -> None:
        p, which, values = own
        run_each_c(_at(states), len(states), command, after, _at(d), t, tick, substeps, _at(p), which, _at(values))

    def roll(path: Array, commands: Array, d: float, t: float, stage: float, substeps: int, p: Array) -> None:
        roll_c(_at(path), _at(commands), len(commands) - 1, d, t, stage, substeps, _at(p))

    def linearise(
        path: Array, A: Array, B: Array, commands: Array, d: float, t: float, stage: float, substeps: int, p: Array
    ) -> None:
        linearise_c(_at(path), _at(A), _at(B), _at(commands), len(commands) - 1, d, t, stage, substeps, _at(p))

    def pursue(path: Array, commands: Array, position: Array, speed: Array, *rest: Any) -> None:
        *numbers, p = rest
        pursue_c(_at(path), _at(commands), _at(position), _at(speed), len(commands) - 1, *numbers, _at(p))

    def holds(path: Array, forces: Array, slopes: Array, t: float, stage: float, p: Array) -> None:
        holds_c(_at(path), _at(forces), _at(slopes), len(path), t, stage, _at(p))

    return {"run": run, "run_each": run_each, "roll": roll, "linearise": linearise, "pursue": pursue, "holds": holds}
