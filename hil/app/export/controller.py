"""`capsule export controller` and `estimator`: a deployment's controller as a folder of C that stands alone."""

import re
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from typing import Any, Final

from controller.drives import envelope_of
from controller.estimator.particle_filter import PARTICLES
from controller.limits import Envelope
from controller.registry import horizon_of, leads
from controller.step.compiled import compiled
from controller.step.daqp_sources import daqp_sources
from controller.step.library import DAQP_FILES, compiler, sources_of
from controller.step.numbers import CHAINS, Numbers, numbers_of
from hil.app.console import note
from hil.app.export.native_node import node_sources
from hil.app.export.ticks import closed_loop, logged
from hil.app.scenario.deployment import Deployment, load_deployment
from hil.app.scenario.model_use import model_for
from hil.nodes.frame_map import frame_map_of
from models.effects import Catalogue
from models.files.toml import check_word, in_file, parse_toml
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
CONTROLLER, ESTIMATOR = "controller", "estimator"
STANDALONE: Final = Path(__file__).with_name("standalone")
"""Files of an exported folder that are the same for all, or templates."""
TEMPLATES: Final = ("Makefile", "CMakeLists.txt", "README.md")
_NEAR: Final = 0.01  # share of the scale within which single precision follows the log before particles differ
_NEAR_TICKS: Final = 200  # of those
_SIMPLEST: Final = "feedforward"  # leads the run that an estimator is tested with, where it can
_ONLY_WITH: Final = dict.fromkeys(("mpc.c", "planner.c", "qp.c"), ("MPC", 1)) | {
    "shaker.c": ("SHAKEN", 1),
    "feedforward.c": ("SHAKEN", 0),
}
"""Sources that a controller needs only where this size is so."""
_OF_ESTIMATOR: Final = ("estimator.c", "model.c", "numbers.c")


@dataclass(frozen=True)
class Asked:
    """What is exported: of the deployment at `path`, with a `stage` of the model file `model` where one is given;
    `form`: with its controller or the estimator alone; `single`: float32; `particles` of its estimator; `short`: a
    shorter plan.
    """

    path: Path
    model: Path | None
    stage: str
    form: str
    single: bool
    particles: int | None = None
    short: bool = False

    @property
    def alone(self) -> bool:
        return self.form == ESTIMATOR


def exported(asked: Asked, known: Catalogue) -> tuple[dict[str, str | bytes], dict[str, Any]]:
    """The files of the folder by their path in it, and facts about them. Raises ValueError of one sentence."""
    deployment = _deployment(asked, known)
    with in_file(asked.path):
        kind = frame_map_of(deployment.rig.kind).drive.name
        name = _SIMPLEST if asked.alone and kind in leads(_SIMPLEST) else deployment.control.controller
        check_word(name, "control.controller of an exported controller", CHAINS)
        model = deployment.believed(deployment.values)
        envelope = envelope_of(model.drive, deployment.limits)
        if asked.short and name != "mpc":
            raise ValueError(f"control.controller must be 'mpc' for --short-plan; got {name!r}")
        horizon = horizon_of(model, short=asked.short)
        numbers = numbers_of(name, model, envelope, particles=asked.particles or PARTICLES, horizon=horizon)
        sources = _sources(numbers, asked)
        files = {**sources, **_daqp(numbers, asked)}
        daqp_sources()  # without which nothing runs in C here
        found = compiled(name, model, envelope, numbers)
        if found is None:
            raise ValueError(TEXT("controller.compiler"))
        ticks = logged(closed_loop(deployment, asked.path), model, name, found.library)
    if not asked.alone:
        files |= {f"node/{file}": text for file, text in node_sources(deployment, envelope).items()}
        if deployment.drive is not None or deployment.bus.key_file:
            note(TEXT("controller.frames"))
    sizes = _sizes(sources)
    words = _words(asked, deployment, numbers, envelope, files) | {
        "ticks": str(ticks.count("\n") - 1),
        **{part: str(size) for part, size in sizes.items()},
    }
    files |= _standalone(asked.form, words)
    facts = {"controller": name, "float32": asked.single, "ticks": ticks.count("\n") - 1, "bytes": sizes}
    return files | {"test/ticks.csv": ticks}, facts


def _deployment(asked: Asked, known: Catalogue) -> Deployment:
    deployment = load_deployment(asked.path, known=known)
    if asked.model is not None:
        learned = model_for(asked.model, deployment.rig.kind, known)
        return replace(deployment, values=learned.believed(asked.stage))
    if deployment.verdict is not None and not deployment.verdict.passed:
        raise ValueError(
            f"{asked.path}: model must pass the acceptance test before it leads; got: {deployment.verdict.sentence}"
        )
    return deployment


def _sources(numbers: Numbers, asked: Asked) -> dict[str, str]:
    """The controller's own C by file name; the header alone says the precision."""
    files = sources_of(numbers) | {"numbers.c": f'#include "elementary.h"\n\n{numbers.stated}'}
    head, rest = files["controller.h"].split("#include <stdint.h>\n", 1)
    single = "#define CAPSULE_FLOAT32\n" if asked.single else ""
    declared = rest.replace(
        '#include "state.h"', 'extern const capsule_numbers capsule_deployment;\n\n#include "state.h"'
    )
    files["controller.h"] = f"{head}#include <stdint.h>\n\n{single}{declared}"
    sizes = numbers.sizes
    needed = [name for name in files if sizes.get((of := _ONLY_WITH.get(name, ("", None)))[0]) == of[1]]
    kept = [name for name in needed if not asked.alone or name.endswith(".h")]
    return {name: files[name] for name in (*kept, *(_OF_ESTIMATOR if asked.alone else ()))}


def _daqp(numbers: Numbers, asked: Asked) -> dict[str, str | bytes]:
    """The files of DAQP that a plan needs, with its licence. Raises ValueError where they are not here."""
    if asked.alone or not numbers.sizes["MPC"]:
        return {}
    folder = daqp_sources()
    paths = [*(folder / "csrc" / "src" / name for name in DAQP_FILES), *(folder / "csrc" / "include").glob("*.h")]
    files: dict[str, str | bytes] = {"daqp/LICENSE": (folder / "LICENSE").read_bytes()}
    return files | {f"daqp/{path.parent.name}/{path.name}": path.read_bytes() for path in sorted(paths)}


def _sizes(sources: Mapping[str, str]) -> dict[str, int]:
    """Bytes of the structures, as this machine's compiler lays them out."""
    names = ("capsule_estimator", "capsule_state", "capsule_in", "capsule_out")
    printed = " ".join(f'printf("%zu ", sizeof({name}));' for name in names)
    main = f'#include "controller.h"\n#include <stdio.h>\nint main(void) {{ {printed} return 0; }}\n'
    with TemporaryDirectory() as folder:
        for name, text in sources.items():
            if name.endswith(".h"):
                Path(folder, name).write_text(text, encoding="utf-8")
        Path(folder, "sizes.c").write_text(main, encoding="utf-8")
        command = [str(compiler()), "-std=c99", "sizes.c", "-o", "sizes"]
        for step in (command, ["./sizes"]):
            done = subprocess.run(step, cwd=folder, capture_output=True, text=True, timeout=60, check=True)
    return dict(zip(names, map(int, done.stdout.split()), strict=True))


def _compared(asked: Asked, envelope: Envelope) -> tuple[list[str], str]:
    """Flags and words of how near to the log a replay comes, in the command's unit or an estimator's m: to the last bit
    in double precision; in single within a share of the magnet's gap, of a coil's current or of the envelope in the
    first ticks, later within all of it. The fewer particles there are, the sooner rounding decides which are drawn
    again.
    """
    near, scale, ticks = 0.0, 0.0, _NEAR_TICKS
    if asked.single:
        scale = envelope.around_m if asked.alone or envelope.placed else envelope.high
        near, ticks = _NEAR * scale, round(ticks * min(1.0, (asked.particles or PARTICLES) / PARTICLES))
    flags = [f"-DREPLAY_NEAR={near:g}", f"-DREPLAY_FAR={scale:g}", f"-DREPLAY_NEAR_TICKS={ticks}"]
    within = {"near": near, "scale": scale, "ticks": ticks, "share": _NEAR}
    return flags, TEXT("controller.near", **within) if near else TEXT("controller.exact")


def _words(
    asked: Asked, deployment: Deployment, numbers: Numbers, envelope: Envelope, files: Mapping[str, Any]
) -> dict[str, str]:
    (tolerance, compared), sizes = _compared(asked, envelope), numbers.sizes
    daqp = [name for name in files if name.startswith("daqp/src/")]
    flags = [*tolerance, *(["-DCAPSULE_ESTIMATOR_ONLY"] if asked.alone else [])]
    flags += ["-DDAQP_SINGLE_PRECISION="] if daqp and asked.single else []
    precision = TEXT("controller.single") if asked.single else TEXT("controller.double")
    model = (
        TEXT("controller.file", stage=asked.stage, name=asked.model.name) if asked.model else TEXT("controller.stated")
    )
    said = {"kind": deployment.rig.kind, "name": deployment.control.controller, "model": model, "precision": precision}
    limit = re.search(r"#define LIMIT (\d+)", str(files.get("qp.c", "")))
    loops = {"plans": sizes["ITERATIONS"], "iterations": limit and limit[1], "particles": sizes["PARTICLES"]}
    return {
        "own": " ".join(name for name in files if name.endswith(".c") and "/" not in name),
        "daqp": " ".join(daqp),
        "flags": " ".join(flags),
        "deployment": asked.path.name,
        "form": asked.form,
        "title": TEXT("estimator.title", **said) if asked.alone else TEXT("controller.title", **said),
        "about": TEXT("estimator.about", **said) if asked.alone else TEXT("controller.about", **said),
        "tick": f"{1e3 * deployment.control.tick_s:g} ms",
        "precision": precision,
        "loops": TEXT("controller.planned", **loops) if limit else TEXT("controller.unplanned", **loops),
        "plant": TEXT("controller.scenario") if "plant" in parse_toml(deployment.text, "") else TEXT("controller.own"),
        "compared": compared,
    }


def _standalone(form: str, words: Mapping[str, str]) -> dict[str, str]:
    """The files that are the same for all, and the templates filled with `words`, less the lines of the other form."""
    files = {}
    for path in sorted(path for path in STANDALONE.rglob("*") if path.is_file()):
        name, text = path.relative_to(STANDALONE).as_posix(), path.read_text(encoding="utf-8")
        if form != CONTROLLER and name.startswith("node/"):
            continue
        if name in TEMPLATES:
            lines = (line.removeprefix(f"{form}:") for line in text.splitlines(keepends=True))
            kept = "".join(line for line in lines if not line.startswith((f"{CONTROLLER}:", f"{ESTIMATOR}:")))
            text = Template(kept).substitute(words)
        files[name] = text
    return files
