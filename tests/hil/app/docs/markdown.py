"""Markdown of the documentation from the templates beside this file."""

from pathlib import Path
from typing import Any

from hil.report.builder import environment


def markdown(template: str, **records: Any) -> str:
    """The Markdown that `template` makes of plain `records`."""
    return environment(Path(__file__).parent).get_template(template).render(**records).strip()
