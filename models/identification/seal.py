"""Seals a model file that was changed by hand: `python -m models.identification.seal MODEL.toml`."""

import sys
from pathlib import Path

from models.files.access import read_text
from models.identification.model import LARGEST_MODEL, Model, sealed


def main(path: Path) -> None:
    """Seal the model file `path`. Raises ValueError of one sentence for what is no model."""
    text = sealed(read_text(path, "model", LARGEST_MODEL))
    Model.from_toml(text)
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    try:
        if len(sys.argv) != 2:
            raise ValueError("one model file must be named: python -m models.identification.seal MODEL.toml")
        main(Path(sys.argv[1]))
    except (OSError, ValueError) as error:
        print(f"seal: {error}", file=sys.stderr)
        sys.exit(2)
