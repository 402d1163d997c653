"""An FMU: the description of its variables, the core compiled behind FMI's functions, both in one archive."""

import hashlib
import io
import platform
import re
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from controller.step.library import compiler

_HERE: Final = Path(__file__).parent
_FLAGS: Final = ("-O2", "-std=gnu11", "-fPIC", "-shared", "-fvisibility=hidden")
_LONGEST_S: Final = 120.0  # for which a compiler may run
_STAMP: Final = (2000, 1, 1, 0, 0, 0)  # of every file in the archive, so that the same input gives the same FMU
_MACHINES: Final = {"amd64": "x86_64", "arm64": "aarch64"}


@dataclass(frozen=True)
class Variable:
    """A Float64 of an FMU: `causality` is input, output or parameter; an output has no start value."""

    name: str
    causality: str
    unit: str
    description: str
    start: float = 0.0


@dataclass(frozen=True)
class FmuUnit:
    """What an FMU is made of: `header` is C with the numbers of `core`; `objects` are linked to it, without any the C
    sources travel, too; `step_s` is the step inside (0: the communication step).
    """

    name: str
    description: str
    variables: Sequence[Variable]
    header: str
    core: Path
    step_s: float
    duration_s: float
    communication_s: float
    objects: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def identifier(self) -> str:
        return re.sub(r"\W", "_", self.name, flags=re.ASCII)


def reference(variables: Sequence[Variable], name: str) -> int:
    """The value reference of a variable: its number after that of time, which is 0."""
    return 1 + next(k for k, v in enumerate(variables) if v.name == name)


def c_header(
    variables: Sequence[Variable], defines: Mapping[str, int | str], outputs: Mapping[str, int], *lines: str
) -> str:
    """C with the numbers of a core: the start values in the order of their references, and for each of `outputs` its
    reference and index.
    """
    pairs = ", ".join(f"{{{reference(variables, name)}, {index}}}" for name, index in outputs.items())
    return "\n".join(
        [
            *(f"#define {name} {value}" for name, value in {"VARIABLES": 1 + len(variables), **defines}.items()),
            f"static const int OUTPUTS[][2] = {{{pairs}}};",
            c_array("double", "START", [0.0, *(v.start for v in variables)]),
            *lines,
        ]
    )


def fmu(unit: FmuUnit) -> bytes:
    """The archive. Raises ValueError of one sentence where there is no C compiler, or one that fails."""
    digest = hashlib.sha256(unit.header.encode() + b"".join(unit.objects.values())).hexdigest()
    token = "{" + str(uuid.uuid5(uuid.NAMESPACE_OID, digest)) + "}"
    source = "\n".join(
        (f'#define TOKEN "{token}"', unit.header, unit.core.read_text("utf-8"), (_HERE / "fmi3.c").read_text("utf-8"))
    )
    # FMI's name of this machine, and the ending of its libraries
    systems = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
    system, ending = systems.get(sys.platform, (sys.platform, ".so"))
    machine = platform.machine().lower()
    folder = f"{_MACHINES.get(machine, machine)}-{system}"
    files = {
        "modelDescription.xml": filled("modelDescription.xml.j2", unit=unit, token=token).encode(),
        f"binaries/{folder}/{unit.identifier}{ending}": _compiled(source, unit.objects),
    }
    if not unit.objects:
        files[f"sources/{unit.identifier}.c"] = source.encode()
        files["sources/buildDescription.xml"] = filled("buildDescription.xml.j2", unit=unit).encode()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
        for name, data in files.items():
            out.writestr(zipfile.ZipInfo(name, _STAMP), data, zipfile.ZIP_DEFLATED)
    return archive.getvalue()


def filled(template: str, **records: Any) -> str:
    """The XML that a template beside this module makes of `records`."""
    how: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    templates = Environment(loader=FileSystemLoader(_HERE), autoescape=True, undefined=StrictUndefined, **how)
    return templates.get_template(template).render(**records)


def _compiled(source: str, objects: Mapping[str, bytes]) -> bytes:
    tool = compiler()
    if tool is None:
        raise ValueError("export fmu must have a C compiler, CAPSULE_COMPILER, cc, gcc or clang; got none")
    with TemporaryDirectory() as folder:
        text, library = Path(folder) / "unit.c", Path(folder) / "unit.so"
        text.write_text(source, encoding="utf-8")
        for name, code in objects.items():
            (Path(folder) / name).write_bytes(code)
        made = [str(Path(folder) / name) for name in objects]
        try:
            subprocess.run(
                [tool, *_FLAGS, "-o", str(library), str(text), *made, "-lm"],
                check=True,
                capture_output=True,
                timeout=_LONGEST_S,
            )
        except (OSError, subprocess.SubprocessError) as error:
            said = getattr(error, "stderr", None) or str(error).encode()
            line = said.decode(errors="replace").strip().splitlines()[:1]
            raise ValueError(f"C compiler {tool} must compile the FMU; got {' '.join(line)}") from None
        return library.read_bytes()


def c_array(kind: str, name: str, values: Sequence[float]) -> str:
    """A constant array in C, its numbers exact."""
    text = [float(v).hex() if kind == "double" else str(int(v)) for v in values]
    lines = [", ".join(text[k : k + 8]) for k in range(0, len(text), 8)]
    return f"static const {kind} {name}[{max(len(text), 1)}] = {{" + ",\n".join(lines) + "};"
