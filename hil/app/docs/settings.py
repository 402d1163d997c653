"""The settings of every room as Markdown tables: value, unit, meaning, and what it was chosen on."""

from dataclasses import fields
from typing import Any

from models.checks.settings import SET as CHECKS
from models.identification.settings import SET as IDENTIFICATION


def _shown(value: Any) -> str:
    return ", ".join(map(_shown, value)) if isinstance(value, tuple) else f"{value:g}"


def tables() -> str:
    """One table a room."""
    lines = []
    for title, record in (("Checks of records", CHECKS), ("Identification", IDENTIFICATION)):
        lines += [
            f"## {title}",
            "",
            "| setting | value | unit | meaning | chosen on |",
            "| --- | --- | --- | --- | --- |",
        ]
        for field in fields(record):
            unit, meaning, chosen_on = field.metadata.values()
            lines.append(f"| `{field.name}` | {_shown(field.default)} | {unit} | {meaning} | {chosen_on} |")
        lines.append("")
    return "\n".join(lines[:-1])
