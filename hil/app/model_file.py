"""Reads the files that close-loop wrote, model.toml and report.json."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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


def read_report(path: Path) -> dict[str, Any]:
    """The object of a report.json; empty where it is another JSON value. Raises ValueError of one sentence."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: report must be the JSON that close-loop wrote; got: {error}") from None
    return found if isinstance(found, dict) else {}
