"""Where the reference trajectories are: `../shared` beside the repository, or the folder that CAPSULE_SHARED names."""

import os
from pathlib import Path

import numpy as np
import pytest

from plant.tables import Floats


@pytest.fixture(scope="session")
def shared() -> Path:
    """The shared folder; the test is skipped without it."""
    folder = Path(os.environ.get("CAPSULE_SHARED", Path(__file__).parents[3] / "shared"))
    if not (folder / "reference").is_dir():
        pytest.skip(f"no reference folder under {folder}; set CAPSULE_SHARED")
    return folder


@pytest.fixture(scope="session")
def rng() -> np.random.Generator:
    """Random numbers with a fixed seed."""
    return np.random.default_rng(20)


def read_columns(path: Path) -> dict[str, Floats]:
    """Columns of a CSV file by name."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    return {name: data[name] for name in data.dtype.names or ()}
