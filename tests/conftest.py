"""What every test may ask for: the folder of shared reference data, a small rig file; and how property tests run."""

import gc
import os
import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from hil.app.main import one_thread
from tests.places import SHARED
from tests.rig_texts import GUT

one_thread()  # as every command: sums on more threads round differently, and fits of chaotic motion end elsewhere
settings.register_profile(
    "new",
    deadline=None,
    print_blob=True,
    max_examples=100,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.register_profile("same", settings.get_profile("new"), derandomize=True)
settings.load_profile(os.environ.get("CAPSULE_EXAMPLES", "same"))


def pytest_xdist_auto_num_workers() -> int:
    """One worker more than processors: tests that wait for a bus leave theirs idle."""
    return 1 + len(os.sched_getaffinity(0))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What collecting makes stays to the end: the garbage collector need not look through it again and again."""
    gc.disable()
    result = yield
    gc.freeze()
    gc.enable()
    return result


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder `shared` beside the checkout (or `CAPSULE_SHARED`): reference trajectories and measured data."""
    if not (SHARED / "reference").is_dir():
        pytest.skip(f"needs the shared reference data: no folder {SHARED}; set CAPSULE_SHARED to where it is")
    return SHARED


@pytest.fixture
def short_path() -> Iterator[Path]:
    """A folder of its own with a short name, as the sockets of a local bus need one."""
    with tempfile.TemporaryDirectory(prefix="c") as folder:
        yield Path(folder)


RIG = f"""{GUT}
[rig]
kind = "magnetic"
magnet_stiffness_N_per_m = 25.0
magnet_range_m = 0.02

[noise]
position_std_m = 5.0e-5
"""


@pytest.fixture
def rig_text() -> str:
    """A complete rig file of kind magnetic."""
    return RIG
