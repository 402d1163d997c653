"""`capsule export controller` and `estimator`: the folder builds without warnings and answers as its log."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from controller.step import library
from controller.step.daqp_sources import daqp_sources
from hil.app.export.ticks import closed_loop
from hil.app.main import run
from hil.app.scenario.bus_scenario import SilScenario
from hil.app.scenario.deployment import load_deployment
from models.identification.model import Model
from tests.hil.app.export.conftest import BASE, FOLDS
from tests.hil.app.export.native import led, native
from tests.hil.app.export.tools import WARNINGS, done, tool
from tests.places import ROOT

SHIPPED = ROOT / "examples" / "deployment"
SHORT = "mpc --particles 100 --short-plan"
WAYS = ("feedforward", "mpc", "feedforward --float32", "mpc --float32", SHORT, "coil", "vibro")
COIL = """[rig]
kind = "coil"
force_constant_N_per_A = 0.5
coil_resistance_Ohm = 10.0
coil_inductance_H = 0.01
current_limit_A = 1.0

"""
INNER_MASS = """[rig]
kind = "vibro"

[drive]
inner_mass_kg = 4e-3
spring_stiffness_N_per_m = 62.0
spring_damping_N_s_per_m = 0.0156
force_N = 0.5
reaction_on_body = true

[surface]
kind = "gut"

"""
OWN_RIG = {"coil": ("feedforward", COIL), "vibro": ("vibro_square", INNER_MASS)}
ON_LINUX = ("main.c", "log.c")
TICKS = 600
ALLOWED_RULES = {
    "2.4": "a structure whose tag is not used",
    "2.5": "constants of the interface that this deployment does not use",
    "5.5": "a function and the macro of its name in single precision",
    "5.9": "one name of static functions in two files",
    "8.7": "a function of the interface that nothing in the folder calls",
    "8.14": "restrict",
    "10.1": "a truth value that is counted",
    "10.3": "whole numbers that are known to fit",
    "10.4": "a number beside one of another kind",
    "10.6": "a product that is widened as it is stored",
    "10.8": "a product that is widened by a cast",
    "12.1": "the usual precedence without parentheses",
    "12.3": "declarations of several variables",
    "13.3": "a counter within an expression",
    "13.4": "an assignment within a condition",
    "14.4": "a number as a condition",
    "15.5": "more than one return",
    "15.6": "a body without braces",
    "15.7": "an else if without an else",
    "17.7": "memcpy's value is not used",
    "18.4": "a pointer plus an index",
    "20.1": "an include after a macro that it reads",
    "20.10": "macros that make the names of a drive's frames",
}
"""Rules of MISRA C 2012 that the hand-written sources break, and what with."""


def deployment(folder: Path, controller: str) -> Path:
    """The shipped deployment with a short run under `controller`; "coil", "vibro": such a rig without a plant."""
    text = (SHIPPED / "deployment.toml").read_text()
    if controller in OWN_RIG:
        controller, rig = OWN_RIG[controller]
        text = re.sub(r"(?s)\[rig\].*?\n\n", rig, text.partition("\n[plant]")[0], count=1)
    text = text.replace('controller = "feedforward"', f'controller = "{controller}"')
    text = text.replace("duration_s = 10.0", f"duration_s = {2e-3 * TICKS:g}")
    (folder / "deployment.toml").write_text(text)
    (folder / "plant.toml").write_text((SHIPPED / "plant.toml").read_text())
    return folder / "deployment.toml"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Exported folders by form and way, each made once."""
    tool("cc")
    folders: dict[tuple[str, str], Path] = {}

    def folder(way: str, form: str = "controller") -> Path:
        if (form, way) not in folders:
            controller, *single = way.split()
            home = tmp_path_factory.mktemp("exported")
            args = ["export", form, str(deployment(home, controller)), "--out", str(home / "out"), *single]
            if controller == "mpc":
                daqp_or_skip()
            assert run(args) == 0
            folders[form, way] = home / "out"
        return folders[form, way]

    return folder


def daqp_or_skip() -> None:
    try:
        daqp_sources()
    except ValueError as error:
        pytest.skip(str(error))


def counts(said: str) -> tuple[int, int]:
    """Passed and failed ticks."""
    found = re.search(r"^(\d+) passed, (\d+) failed$", said, re.MULTILINE)
    assert found is not None, said[-2000:]
    return int(found[1]), int(found[2])


@pytest.mark.parametrize("way", WAYS)
def test_replays_its_log(way: str, made: Callable[..., Path]) -> None:
    passed, failed = counts(done([tool("make"), "test"], made(way)))
    assert failed == 0
    assert passed > 0.9 * TICKS


@pytest.mark.parametrize("way", ["feedforward", "feedforward --float32", "vibro"])
def test_estimator_replays_its_log(way: str, made: Callable[..., Path]) -> None:
    folder = made(way, "estimator")
    assert counts(done([tool("make"), "test"], folder)) == (TICKS, 0)
    assert not (folder / "node").exists()
    assert not (folder / "chain.c").exists()


@pytest.mark.parametrize("way", ["feedforward", "feedforward --float32"])
def test_replay_fails_where_a_number_is_another(way: str, made: Callable[..., Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(made(way), tmp_path / "spoiled"))
    numbers = (folder / "numbers.c").read_text()
    spoiled = re.sub(r"R\(([^)]+)\), /\* loop_k_p \*/|R\(([^)]+)\), /\* gap_m \*/", "R(1e-3), /* spoiled */", numbers)
    assert spoiled != numbers
    (folder / "numbers.c").write_text(spoiled)
    ran = subprocess.run([tool("make"), "test"], cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode != 0
    assert counts(ran.stdout)[1] > 10


def test_a_found_model_leads(made: Callable[..., Path], tmp_path: Path) -> None:
    values = BASE | {"magnet_stiffness_N_per_m": 24.2}
    stages = {"nominal": values, "calibrated": values, "augmented": values | FOLDS}
    (tmp_path / "model.toml").write_text(Model("magnetic", stages).to_toml())
    args = ["export", "controller", str(deployment(tmp_path, "feedforward")), "--model", str(tmp_path / "model.toml")]
    assert run([*args, "--out", str(tmp_path / "out")]) == 0
    passed, failed = counts(done([tool("make"), "test"], tmp_path / "out"))
    assert failed == 0
    assert passed > 0.9 * TICKS
    assert (tmp_path / "out" / "numbers.c").read_text() != (made("feedforward") / "numbers.c").read_text()
    assert "the augmented model of model.toml" in (tmp_path / "out" / "README.md").read_text()


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("way", WAYS)
def test_no_warnings(way: str, compiler: str, made: Callable[..., Path], tmp_path: Path) -> None:
    folder, cc = made(way), tool(compiler)
    for path in [*folder.glob("*.c"), *folder.glob("node/*.c"), *folder.glob("test/*.c"), folder / "m7" / "bare.c"]:
        flags = [*WARNINGS, *flags_of(folder), "-I.", "-Inode", "-Idaqp/include"]
        own = [*flags, "-std=gnu99"] if path.name in ON_LINUX else flags
        done([cc, *own, "-O2", "-c", path, "-o", tmp_path / "made.o"], folder)


def flags_of(folder: Path) -> list[str]:
    line = next(line for line in (folder / "Makefile").read_text().splitlines() if line.startswith("FLAGS"))
    return line.partition(":=")[2].split()


@pytest.mark.parametrize("way", ["mpc", "vibro"])
def test_cppcheck_finds_nothing(way: str, made: Callable[..., Path]) -> None:
    folder = made(way)
    written = written_by_hand(folder)
    more = ["--enable=warning,style,performance,portability", "--max-configs=1", drive_of(folder)]
    allowed = ["--suppress=variableScope", "--suppress=missingInclude", "--suppress=unusedStructMember"]
    done([tool("cppcheck"), "--quiet", "--std=c99", "--error-exitcode=1", *more, *allowed, "-I.", *written], folder)


@pytest.mark.parametrize("way", ["mpc", "vibro"])
def test_rules_of_misra(way: str, made: Callable[..., Path]) -> None:
    folder = made(way)
    command = [tool("cppcheck"), "--quiet", "--std=c99", "--addon=misra", "--max-configs=1", drive_of(folder)]
    places = ["-I.", "-Inode", "-Idaqp/include", "--template={id} {file}:{line}"]
    said = done([*command, *places, *written_by_hand(folder)], folder)
    if "misra-c2012" not in said:
        pytest.skip(f"cppcheck has no addon misra here: {said[:200]}")
    own = [line for line in said.splitlines() if "daqp/" not in line and "frames.h" not in line]
    broken = set(re.findall(r"misra-c2012-([0-9.]+)", "\n".join(own)))
    assert len(broken) > 5
    assert broken <= set(ALLOWED_RULES), own


def drive_of(folder: Path) -> str:
    found = re.search(r"#define (NODE_(?:CARRIAGE|COIL|INNER_MASS)) 1", (folder / "node" / "deployment.h").read_text())
    assert found is not None
    return f"-D{found[1]}=1"


def written_by_hand(folder: Path) -> list[Path]:
    """The C sources but for the generated ones, which would take minutes, and those of a program on Linux."""
    generated = ("model.c", "numbers.c", "frames.c")
    found = [*folder.glob("*.c"), *folder.glob("node/*.c")]
    return sorted(path.relative_to(folder) for path in found if path.name not in (*generated, *ON_LINUX, "replay.c"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "compiler", "form"),
    [
        ("feedforward", "gcc", "controller"),
        ("feedforward", "clang", "estimator"),
        ("mpc", "clang", "controller"),
        ("mpc --float32", "gcc", "controller"),
        ("coil", "clang", "controller"),
        ("vibro", "gcc", "controller"),
    ],
)
def test_any_bits_may_come_in(way: str, compiler: str, form: str, made: Callable[..., Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(made(way, form), tmp_path / "folder"))
    assert "4000 ticks" in done([tool("make"), "fuzz", f"CC={tool(compiler)}", "TICKS=4000"], folder, 600.0)


@pytest.mark.slow
@pytest.mark.parametrize("way", ["feedforward", "mpc", "mpc --float32", "vibro"])
def test_same_commands_on_a_cortex_m7(way: str, made: Callable[..., Path], tmp_path: Path) -> None:
    """The log's first ticks, as the processor is emulated."""
    tool("qemu-system-arm")
    tool("arm-none-eabi-gcc")
    folder = Path(shutil.copytree(made(way), tmp_path / "folder"))
    ticks = folder / "test" / "ticks.csv"
    ticks.write_text("".join(ticks.read_text().splitlines(keepends=True)[:251]))
    said = done([tool("make"), "m7"], folder)
    passed, failed = counts(said)
    assert failed == 0
    assert passed > 200
    most = re.search(r"instructions: median (\d+), 99 of 100 (\d+), most (\d+)", said)
    assert most is not None
    assert 1e4 < int(most[1]) <= int(most[2]) <= int(most[3]) < 5e6  # the counter's own range


def test_cmake_builds_it(made: Callable[..., Path], tmp_path: Path) -> None:
    cmake, ctest = tool("cmake"), tool("ctest")
    done([cmake, "-S", made("feedforward"), "-B", tmp_path], tmp_path)
    done([cmake, "--build", tmp_path], tmp_path)
    assert "100% tests passed" in done([ctest], tmp_path)


@pytest.mark.parametrize("way", ["feedforward", "mpc", SHORT, "feedforward --float32", "coil", "vibro"])
def test_native_node_leads_the_simulated_plant(way: str, made: Callable[..., Path], tmp_path: Path) -> None:
    scenario = short(tmp_path, way.split()[0])
    found = led(native(made(way)), scenario, 4.0)
    assert (found.led, found.reason, found.rejected) == (True, "", 0)
    assert found.tracking_rmse_m < 1e-3


def test_native_node_stops_without_frames(made: Callable[..., Path], tmp_path: Path) -> None:
    found = led(native(made("feedforward")), short(tmp_path, "feedforward"), 1.5, cut_s=1.0)
    assert found.led
    assert found.reason == "feedback lost"
    assert found.state not in (4, 5)  # enabled, derated


def test_replay_of_the_native_nodes_log(
    made: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A whole log, one cut off in a line as by a loss of power, and one with another command."""
    tool("make")
    folder = made("feedforward")
    log = folder / "run.log"
    assert led(native(folder), short(tmp_path, "feedforward"), 2.0, log=log).led
    assert run(["replay", str(log)]) == 0
    assert "1000 ticks" in (said := capsys.readouterr().out)
    assert "identical" in said
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-1]) + lines[-2][:20])
    assert run(["replay", str(log)]) == 1
    assert "identical as far as the log goes" in capsys.readouterr().out
    sent = [k for k, line in enumerate(lines) if line.endswith("T\n") and " node 100#" in line]
    spoiled = re.sub("#....", "#0000", lines[sent[-1]])
    log.write_text("".join([*lines[: sent[-1]], spoiled, *lines[sent[-1] + 1 :]]))
    assert run(["replay", str(log), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["different_ticks"] == 1


def test_a_killed_nodes_log_is_kept(made: Callable[..., Path], tmp_path: Path) -> None:
    """What the node handed over before SIGKILL is on file."""
    folder, log = made("feedforward"), tmp_path / "run.log"
    native(folder)
    killed = subprocess.run([sys.executable, "-c", KILLED, folder / "native.so", log], check=False)
    assert killed.returncode == -signal.SIGKILL
    waited = time.monotonic() + 20.0
    while time.monotonic() < waited and sum(" 080#" in line for line in log.read_text().splitlines()) < 500:
        time.sleep(0.1)
    assert sum(" 080#" in line for line in log.read_text().splitlines()) == 500


KILLED = """import ctypes, os, signal, sys
node, room = ctypes.CDLL(sys.argv[1]), (ctypes.c_char * 96)()
node.speak.argtypes = node.tick.argtypes = [ctypes.c_double, ctypes.c_void_p]
node.begin()
node.log_to(sys.argv[2].encode())
for k in range(500):
    node.speak(0.002 * k, room)
    node.tick(0.002 * k, room)
os.kill(os.getpid(), signal.SIGKILL)
"""


def short(folder: Path, controller: str) -> SilScenario:
    path = deployment(folder, controller)
    scenario = closed_loop(load_deployment(path), path)
    return replace(scenario, loop=replace(scenario.loop, control=scenario.loop.control.but(probe=False)))


def test_native_node_says_that_there_is_no_bus(made: Callable[..., Path]) -> None:
    folder = made("feedforward")
    done([tool("make"), "node"], folder)
    ran = subprocess.run(["build/node", "nothing0"], cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert "CAN interface" in ran.stderr


def test_native_node_leads_on_a_real_can_bus(made: Callable[..., Path], tmp_path: Path) -> None:
    if not Path("/sys/class/net/vcan0").exists():
        pytest.skip("there is no interface vcan0: ip link add dev vcan0 type vcan && ip link set vcan0 up")
    folder = made("feedforward")
    done([tool("make"), "node"], folder)
    text = deployment(tmp_path, "feedforward").read_text()
    text = text.replace('"capsule_local"', '"socketcan"').replace('channel = "deployment"', 'channel = "vcan0"')
    (tmp_path / "deployment.toml").write_text(text)
    program = "import sys; from hil.app.start import main; sys.exit(main())"
    words = [sys.executable, "-c", program, "plant", str(tmp_path / "deployment.toml"), "--seconds", "60"]
    plant = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        assert plant.stdout is not None
        assert plant.stdout.readline().strip() == "ready"
        said = done([folder / "build" / "node", "vcan0", "5", "vcan.log"], folder)
        assert "ended: done" in said
        assert "missing in the log 0" in said
        assert run(["replay", str(folder / "vcan.log")]) == 0
    finally:
        plant.terminate()
        plant.wait()
        assert plant.stdout is not None
        plant.stdout.close()


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["controller", "--out", "o"], "DEPLOYMENT.toml"),
        (["controller", "missing.toml", "--out", "o"], "missing.toml"),
        (["controller", "d.toml", "--rig", "d.toml", "--out", "o"], "--rig"),
        (["controller", "d.toml", "--model", "d.toml", "--out", "o"], "d.toml"),
        (["controller", "d.toml", "--stage", "best", "--out", "o"], "--stage"),
        (["controller", "d.toml", "--out", "d.toml"], "folder"),
        (["controller", "pid.toml", "--out", "o"], "control.controller"),
        (["estimator", "pull.toml", "--out", "o"], "rig.kind"),
        (["controller", "d.toml", "--short-plan", "--out", "o"], "--short-plan"),
        (["fmu", "d.toml", "--float32", "--out", "o.fmu"], "--float32"),
        (["fmu", "d.toml", "--particles", "100", "--out", "o.fmu"], "--particles"),
        (["controler", "d.toml", "--out", "o"], "did you mean 'controller'?"),
    ],
)
def test_refusals_are_a_sentence(
    args: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = deployment(tmp_path, "feedforward").read_text()
    (tmp_path / "d.toml").write_text(text)
    (tmp_path / "pid.toml").write_text(text.replace('"feedforward"', '"pid_measured"'))
    (tmp_path / "pull.toml").write_text(re.sub(r"(?s)\[rig\].*?\n\n", '[rig]\nkind = "pull"\n\n', text))
    assert run(["export", *args]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize("way", ["feedforward", "mpc"])
def test_missing_sources_of_daqp_are_said(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert run(["export", "controller", str(deployment(tmp_path, way)), "--out", str(tmp_path / "o")]) == 2
    assert "make setup" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_no_compiler_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(library, "compiler", lambda: None)
    assert run(["export", "controller", str(deployment(tmp_path, "feedforward")), "--out", str(tmp_path / "o")]) == 2
    assert "C compiler" in capsys.readouterr().err
    assert not (tmp_path / "o").exists()


def test_json_names_the_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of a deployment with authenticated frames, which the folder's node does not speak: a note says so."""
    tool("cc")
    out, path = tmp_path / "o", deployment(tmp_path, "feedforward")
    path.write_text(path.read_text().replace("fd = false", 'fd = true\nkey_file = "bus.key"'))
    assert run(["export", "controller", str(path), "--out", str(out), "--json"]) == 0
    said = capsys.readouterr()
    assert "capsule.dbc alone" in said.err
    found = json.loads(said.out)
    assert all(Path(file).is_file() for file in found["files"])
    assert {"controller.h", "Makefile", "CMakeLists.txt", "README.md"} <= {path.name for path in out.iterdir()}
    assert found["ticks"] == TICKS
    assert found["bytes"]["capsule_state"] < 256 * 1024
