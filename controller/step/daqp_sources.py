"""DAQP's C sources (MIT licence), which `make setup` fetches from the package index."""

import sys
from pathlib import Path


def daqp_sources() -> Path:
    """The folder with `LICENSE` and `csrc`. Raises ValueError of one sentence where it is missing."""
    folder = Path(sys.prefix) / "share" / "capsule" / "daqp"
    if not (folder / "LICENSE").is_file():
        raise ValueError(f"{folder} must hold the C sources of DAQP, which 'make setup' fetches; it does not")
    return folder
