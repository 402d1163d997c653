"""Tables of plain values as TOML text."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def toml_text(tables: Mapping[str, Any], path: str = "") -> str:
    """`tables` as TOML that reads back as the same; keys must be bare ones, values numbers, booleans, text or lists of these."""
    values = {key: value for key, value in tables.items() if not isinstance(value, Mapping)}
    lines = [f"[{path}]"] if path and (values or not tables) else []
    lines += [f"{key} = {_value(value)}" for key, value in values.items()]
    text = "\n".join([*lines, ""]) + "\n" if lines else ""
    within = f"{path}." if path else ""
    return text + "".join(toml_text(table, within + key) for key, table in tables.items() if isinstance(table, Mapping))


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(item) for item in value)}]"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
