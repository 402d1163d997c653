"""Reads a file that close-loop wrote as model.toml."""

from __future__ import annotations

from pathlib import Path

from models.identification import Model

LARGEST_MODEL = 1 << 22


def read_model(path: Path, kind: str, *others: str) -> Model:
    """The model of a file, for rigs of `kind` or one of the `others`; a ValueError of one sentence where it is none."""
    try:
        if path.stat().st_size > LARGEST_MODEL:
            raise ValueError(f"{path}: model must be smaller than {LARGEST_MODEL} bytes; got {path.stat().st_size}")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ValueError(f"{path}: model must be a file that can be read; got: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: model must be UTF-8 text; got another byte at {error.start}") from None
    try:
        model = Model.from_toml(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if model.kind not in (kind, *others):
        raise ValueError(f"{path}: model must be one of a {' or '.join((kind, *others))} rig; got one of a {model.kind} rig")
    return model
