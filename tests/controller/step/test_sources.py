"""The C sources: no warning by either compiler, in both precisions; the same numbers by each; the model's code."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from controller.drives import envelope_of
from controller.model.control_model import control_model
from controller.step.daqp_sources import daqp_sources
from controller.step.library import FLAGS, Library, loaded, pointer_to, sources_of
from controller.step.model_code import literal
from controller.step.numbers import Numbers, numbers_of
from models.theta import Theta
from tests.controller.loops import believed, model_of
from tests.controller.step.loops import needs_compiler

pytestmark = needs_compiler
STRICT = ("-Wall", "-Wextra", "-Werror", "-Wconversion", "-fsyntax-only")


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("more", [(), ("-DCAPSULE_FLOAT32",)])
def test_the_sources_compile_without_a_warning(compiler: str, more: tuple[str, ...], tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    model = model_of("coil")
    for name, text in sources_of(numbers_of("mpc", model, envelope_of(model.drive))).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    names = [path.name for path in sorted(tmp_path.glob("*.c"))]
    command = [compiler, *FLAGS, *STRICT, *more, "-isystem", str(daqp_sources() / "csrc" / "include"), *names]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr


EFFECTS = {
    ("carriage_backlash", "play_m"): 4e-4,
    ("fold_periodic", "depth"): 0.3,
    ("fold_periodic", "wavelength_m"): 7e-3,
    ("sensor_scale", "scale"): 0.02,
    ("respiration", "amplitude_N"): 5e-3,
}


def rich() -> tuple[Numbers, Library]:
    """A controller of a rig with effects of force, wall, drive and sensor."""
    model = control_model(believed(), Theta.of(EFFECTS.items()), 1e-3)
    numbers = numbers_of("mpc", model, envelope_of(model.drive))
    library = loaded(numbers)
    assert library is not None
    return numbers, library


def test_the_models_code_is_the_kernels_arithmetic() -> None:
    model = control_model(believed(), Theta.of(EFFECTS.items()), 1e-3)
    _, library = rich()
    parameters = np.ascontiguousarray(model.values)
    draws, real = np.random.default_rng(0), ctypes.c_double
    for one, name in ((model.sharp, "capsule_sharp_step"), (model, "capsule_plan_step")):
        for _ in range(50):
            x = one.initial(1e-3, 1e-3) + 1e-4 * draws.standard_normal(len(one.states))
            x[[one.index(mode) for mode in one.modes]] = draws.integers(-1, 2, len(one.modes))
            d, kernel, ours = 1e-3 * draws.standard_normal(), x[None].copy(), x.copy()
            one.kernels.run(kernel, 1e-3, 1.2e-3, np.array([d]), 0.3, 1e-3, 1, parameters)
            scalars = (real(value) for value in (1e-3, 1.2e-3, d, 0.3, 1e-3))
            getattr(library.functions, name)(pointer_to(ours), *scalars, pointer_to(parameters))
            np.testing.assert_allclose(ours, kernel[0], rtol=1e-9, atol=1e-15)


def test_a_kind_of_model_is_compiled_once_for_all_its_numbers() -> None:
    numbers, library = rich()
    others = {**EFFECTS, ("fold_periodic", "depth"): 0.2}
    model = control_model(believed(), Theta.of(others.items()), 1e-3)
    same = numbers_of("mpc", model, envelope_of(model.drive))
    assert loaded(same) is library
    assert not np.array_equal(same.vector, numbers.vector)
    assert all(literal(float(one)) in same.stated for one in same.vector)
