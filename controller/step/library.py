"""The C controller compiled by the machine's own compiler, once a kind of model, kept on disk and loaded."""

import ctypes
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import llvmlite.binding as llvm

from controller.signals import Array
from controller.step.daqp_sources import daqp_sources
from controller.step.numbers import Numbers
from models.files.access import cache_folder

FLAGS: Final = ("-std=c99", "-O2", "-ffp-contract=off")
"""Of every compilation: without contraction float64 results are the same to the last bit, whatever the optimisation."""
_HERE: Final = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-fno-tree-slp-vectorize")
_SHARED: Final = ("-shared", "-fPIC", "-fvisibility=default", "-w")
DAQP_FILES: Final = ("daqp.c", "auxiliary.c", "factorization.c")
SOURCES: Final = Path(__file__).with_name("sources")
_LONGEST_S: Final = 300.0  # of a compilation
_LAYOUT: Final = """#include <stddef.h>
#include "controller.h"
const size_t capsule_layout[] = {
    sizeof(capsule_estimator), sizeof(capsule_controller), sizeof(capsule_state),
    offsetof(capsule_estimator, belief), offsetof(capsule_controller, issued), offsetof(capsule_controller, reason),
    sizeof(capsule_belief), sizeof(capsule_in), sizeof(capsule_out),
};
"""
_LOADING: Final = threading.Lock()
_LOADED: Final[dict[str, "Library | None"]] = {}


class Reading(ctypes.Structure):
    """`capsule_reading`"""

    _fields_ = (("stamp_s", ctypes.c_double), ("value", ctypes.c_double), ("channel", ctypes.c_int))


class Event(ctypes.Structure):
    """`capsule_event`"""

    _fields_ = (("before", ctypes.c_int), ("after", ctypes.c_int), ("reason", ctypes.c_int))


class Issued(ctypes.Structure):
    """`capsule_issued`"""

    _fields_ = tuple((name, ctypes.c_double) for name in ("command", "rate", "aim"))


READINGS: Final = 8
_EVENTS: Final = 4


class Out(ctypes.Structure):
    """`capsule_out`"""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("command", "rate")),
        *((name, ctypes.c_int) for name in ("status", "active", "limits", "iterations", "plans", "halted")),
        *((name, ctypes.c_int) for name in ("lost", "events")),
        ("event", Event * _EVENTS),
        *((name, ctypes.c_double) for name in ("position_m", "speed_m_s", "std_m", "disturbance_N")),
        *((name, ctypes.c_double) for name in ("friction_scale", "resting_s")),
    )


def structures(sizes: Mapping[str, int | str]) -> tuple[Any, Any]:
    """`capsule_in` and `capsule_belief` of these sizes as ctypes structures."""
    real, states, stages = ctypes.c_double, int(sizes["STATES"]), int(sizes["STAGES"]) + 1
    given = (
        ("time_s", ctypes.c_double),
        ("readings", ctypes.c_int),
        ("halt", ctypes.c_int),
        ("reading", Reading * READINGS),
        ("in_force", real),
        ("position_m", real * stages),
        ("speed_m_s", real * stages),
        *((name, real) for name in ("next_speed_m_s", "least", "most", "temperature_C")),
    )
    found = (
        ("time_s", ctypes.c_double),
        ("state", real * states),
        ("std", real * states),
        *((name, real) for name in ("lacking_N", "force_N")),
        ("parameters", real * int(sizes["PARAMETERS"])),
        *((name, real) for name in ("level", "surprise", "offset")),
        ("innovation", real * READINGS),
        *((name, ctypes.c_int) for name in ("innovations", "lost", "learned")),
        *((name, ctypes.c_uint32) for name in ("accepted", "outliers", "unusable", "restarts", "followed")),
    )
    return type("In", (ctypes.Structure,), {"_fields_": given}), type(
        "Belief", (ctypes.Structure,), {"_fields_": found}
    )


class Library:
    """A loaded controller: its functions, structures and sizes in bytes of estimator, controller and state."""

    def __init__(self, path: Path, numbers: Numbers) -> None:
        self.functions = ctypes.CDLL(str(path))
        self.In, self.Belief = structures(numbers.sizes)
        layout = (ctypes.c_size_t * 9).in_dll(self.functions, "capsule_layout")
        self.estimator, self.controller, self.state, self.belief_at, self.issued_at, self.reason_at = layout[:6]
        made = [ctypes.sizeof(one) for one in (self.Belief, self.In, Out)]
        assert list(layout[6:]) == made, f"structures of {list(layout[6:])} bytes must be read as such; got {made}"
        for name in ("capsule_init", "capsule_estimator_init", "capsule_controller_init"):
            getattr(self.functions, name).restype = None
        self.stages = int(numbers.sizes["STAGES"])


def compiler() -> str | None:
    """The C compiler: `CAPSULE_COMPILER`, else cc, gcc or clang; None without one, and where that is `none`."""
    wanted = os.environ.get("CAPSULE_COMPILER", "")
    named = () if wanted == "none" else (wanted, "cc", "gcc", "clang")
    return next((found for name in named if name and (found := shutil.which(name))), None)


def available() -> bool:
    """Whether controllers run in C here: there is a compiler, and DAQP's sources are."""
    try:
        return compiler() is not None and daqp_sources().is_dir()
    except ValueError:
        return False


def sources_of(numbers: Numbers) -> dict[str, str]:
    """The C files of a controller by name, without DAQP's: those written by hand and those generated."""
    files = {path.name: path.read_text(encoding="utf-8") for path in sorted(SOURCES.glob("*.[ch]"))}
    return files | {"numbers.h": numbers.declared, "model.c": numbers.model}


def loaded(numbers: Numbers) -> Library | None:
    """The compiled controller of `numbers`; None unless controllers run in C here (`available`), and where it does not
    compile, which is said once on standard error.
    """
    cc = compiler()
    if cc is None or not available():
        return None
    files = sources_of(numbers) | {"layout.c": _LAYOUT}
    qp = daqp_sources() / "csrc"
    machine = (cc, os.stat(cc).st_mtime, llvm.get_host_cpu_name(), FLAGS, _HERE, str(qp))
    key = hashlib.sha256(repr((machine, sorted(files.items()))).encode()).hexdigest()[:20]
    with _LOADING:
        if key not in _LOADED:
            path = cache_folder() / f"capsule_step_{key}.so"
            why = "" if path.exists() else _compiled(cc, files, qp, path)
            if why:
                print(f"the C compiler {cc} does not compile the controller: {why}", file=sys.stderr)
            _LOADED[key] = None if why else Library(path, numbers)
        return _LOADED[key]


def _compiled(cc: str, files: Mapping[str, str], qp: Path, path: Path) -> str:
    """Compile `files` to the shared library `path`; why not, or ""."""
    with tempfile.TemporaryDirectory(prefix=".step-", dir=path.parent) as folder:
        for name, text in files.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        names = [name for name in files if name.endswith(".c")]
        more = [f"-I{qp / 'include'}", *(str(qp / "src" / name) for name in DAQP_FILES)]
        command = [cc, *FLAGS, *_HERE, *_SHARED, "-o", "made.so", *names, *more, "-lm"]
        try:
            run = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_LONGEST_S, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            return str(error)
        if run.returncode:
            return " ".join(run.stderr.split())[:300]
        os.replace(Path(folder, "made.so"), path)
    return ""


def pointer_to(numbers: Array) -> ctypes.c_void_p:
    """The address of a contiguous array."""
    return ctypes.c_void_p(numbers.ctypes.data)


def memory(size: int) -> "ctypes.Array[ctypes.c_double]":
    """Zeros of `size` bytes."""
    return (ctypes.c_double * (size // ctypes.sizeof(ctypes.c_double) + 1))()
