"""Random numbers and columns that the plant's tests share."""

from pathlib import Path

import numpy as np
import pytest

from plant.tables import Floats


@pytest.fixture(scope="session")
def rng() -> np.random.Generator:
    """Random numbers with a fixed seed."""
    return np.random.default_rng(20)


def read_columns(path: Path) -> dict[str, Floats]:
    """Columns of a CSV file by name."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    return {name: data[name] for name in data.dtype.names or ()}
