"""The settings of every room as Markdown tables: value, unit, meaning, and what it was chosen on."""

from typing import Any, Final

from models.files.toml import beside
from tests.hil.app.docs.markdown import markdown
from tests.places import ROOT

ROOMS: Final = {"Checks of records": "checks", "Identification": "identification"}


def _shown(value: Any) -> str:
    return ", ".join(map(_shown, value)) if isinstance(value, list) else f"{value:g}"


def tables() -> str:
    """One table a room."""
    shown = {}
    for title, room in ROOMS.items():
        rows = beside(str(ROOT / "models" / room / "settings.py"), "settings.toml").items()
        shown[title] = [(name, _shown(value), *said, *["by hand"] * (len(said) < 3)) for name, (value, *said) in rows]
    return markdown("settings.md.j2", rooms=shown)
