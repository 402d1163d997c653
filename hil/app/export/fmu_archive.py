"""An FMU: the description of its variables, the core compiled behind FMI's functions, both in one archive."""

import hashlib
import io
import os
import platform
import re
import shutil
import subprocess
import sys
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from xml.sax.saxutils import quoteattr

_FMI: Final = Path(__file__).with_name("fmi3.c")
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
    """The value reference of a variable: its place after time, which is 0."""
    return 1 + next(k for k, v in enumerate(variables) if v.name == name)


def start_values(variables: Sequence[Variable]) -> list[float]:
    """The values at instantiation in the order of their references."""
    return [0.0, *(v.start for v in variables)]


def fmu(unit: FmuUnit) -> bytes:
    """The archive. Raises ValueError of one sentence where there is no C compiler, or one that fails."""
    digest = hashlib.sha256(unit.header.encode() + b"".join(unit.objects.values())).hexdigest()
    token = "{" + str(uuid.uuid5(uuid.NAMESPACE_OID, digest)) + "}"
    source = "\n".join((f'#define TOKEN "{token}"', unit.header, unit.core.read_text("utf-8"), _FMI.read_text("utf-8")))
    folder, ending = _platform()
    files = {
        "modelDescription.xml": model_description(unit, token).encode(),
        f"binaries/{folder}/{unit.identifier}{ending}": _compiled(source, unit.objects),
    }
    if not unit.objects:
        files[f"sources/{unit.identifier}.c"] = source.encode()
        files["sources/buildDescription.xml"] = _build_description(unit).encode()
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as out:
        for name, data in files.items():
            out.writestr(zipfile.ZipInfo(name, _STAMP), data, zipfile.ZIP_DEFLATED)
    return archive.getvalue()


def model_description(unit: FmuUnit, token: str) -> str:
    """`modelDescription.xml` of FMI 3.0."""
    units = sorted({v.unit for v in unit.variables} | {"s"})
    outputs = [k for k, v in enumerate(unit.variables, 1) if v.causality == "output"]
    fixed = f' fixedInternalStepSize="{unit.step_s!r}"' if unit.step_s else ""
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<fmiModelDescription fmiVersion="3.0" modelName={quoteattr(unit.name)} instantiationToken="{token}"'
            f' description={quoteattr(unit.description)} generationTool="capsule">',
            f'  <CoSimulation modelIdentifier="{unit.identifier}" canHandleVariableCommunicationStepSize="true"'
            f' canGetAndSetFMUState="true" canSerializeFMUState="true"{fixed}/>',
            "  <UnitDefinitions>",
            *(f"    <Unit name={quoteattr(name)}/>" for name in units),
            "  </UnitDefinitions>",
            f'  <DefaultExperiment startTime="0.0" stopTime="{unit.duration_s!r}"'
            f' stepSize="{unit.communication_s!r}"/>',
            "  <ModelVariables>",
            '    <Float64 name="time" valueReference="0" causality="independent" variability="continuous" unit="s"/>',
            *(_variable(k, v) for k, v in enumerate(unit.variables, 1)),
            "  </ModelVariables>",
            "  <ModelStructure>",
            *(f'    <Output valueReference="{k}"/>' for k in outputs),
            *(f'    <InitialUnknown valueReference="{k}"/>' for k in outputs),
            "  </ModelStructure>",
            "</fmiModelDescription>",
            "",
        ]
    )


def _variable(number: int, v: Variable) -> str:
    said = {
        "input": f'causality="input" variability="continuous" start="{v.start!r}"',
        "output": 'causality="output" variability="continuous" initial="calculated"',
        "parameter": f'causality="parameter" variability="fixed" start="{v.start!r}"',
    }[v.causality]
    return (
        f'    <Float64 name={quoteattr(v.name)} valueReference="{number}" {said} unit={quoteattr(v.unit)}'
        f" description={quoteattr(v.description)}/>"
    )


def _build_description(unit: FmuUnit) -> str:
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            '<fmiBuildDescription fmiVersion="3.0">',
            f'  <BuildConfiguration modelIdentifier="{unit.identifier}">',
            f'    <SourceFileSet language="C11"><SourceFile name="{unit.identifier}.c"/></SourceFileSet>',
            '    <Library name="m"/>',
            "  </BuildConfiguration>",
            "</fmiBuildDescription>",
            "",
        ]
    )


def _platform() -> tuple[str, str]:
    """FMI's name of this machine and the ending of its libraries."""
    system = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
    name, ending = system.get(sys.platform, (sys.platform, ".so"))
    machine = platform.machine().lower()
    return f"{_MACHINES.get(machine, machine)}-{name}", ending


def _compiled(source: str, objects: Mapping[str, bytes]) -> bytes:
    wanted = os.environ.get("CAPSULE_COMPILER", "")
    named = () if wanted == "none" else (wanted, "cc", "gcc", "clang")
    tool = next((found for name in named if name and (found := shutil.which(name))), None)
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
