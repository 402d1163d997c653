"""The settings of every room as Markdown tables: value, unit, meaning, and what it was chosen on."""

from dataclasses import fields
from typing import Any

from models.checks.settings import SET as CHECKS
from models.identification.settings import SET as IDENTIFICATION
from tests.hil.app.docs.markdown import markdown


def _shown(value: Any) -> str:
    return ", ".join(map(_shown, value)) if isinstance(value, tuple) else f"{value:g}"


def tables() -> str:
    """One table a room."""
    rooms: dict[str, Any] = {"Checks of records": CHECKS, "Identification": IDENTIFICATION}
    shown = {
        title: [(field.name, _shown(field.default), *field.metadata.values()) for field in fields(room)]
        for title, room in rooms.items()
    }
    return markdown("settings.md.j2", rooms=shown)
