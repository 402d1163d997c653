"""Writes the generated parts of docs/*.md between their markers: `python -m tests.hil.app.docs.pages` after a change of
a schema or of the catalogue of effects.
"""

import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from tests.hil.app.docs import api, buttons, effects, ends, keys, settings

PARTS: Final[Mapping[str, Callable[[], str]]] = MappingProxyType(
    {
        "columns": keys.columns,
        "formats": keys.formats,
        "rig-keys": keys.rig_keys,
        "deployment-keys": keys.deployment_keys,
        "effects": effects.catalogue,
        "ends": ends.table,
        "api": api.reference,
        "buttons": buttons.part,
        "settings": settings.tables,
    }
)
"""What stands between the markers of each name."""
_MARKED: Final = re.compile(r"(<!-- generated: ([a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(page: str) -> str:
    """A page's text with every generated part made anew. Raises ValueError for a marker of an unknown name."""

    def part(found: re.Match[str]) -> str:
        if found[2] not in PARTS:
            raise ValueError(f"generated part must be one of {', '.join(PARTS)}; got {found[2]!r}")
        return f"{found[1]}\n{PARTS[found[2]]()}\n\n{found[3]}"

    return _MARKED.sub(part, page)


def main(folder: Path) -> None:
    """Fill every page of `folder`."""
    for path in sorted(folder.rglob("*.md")):
        text = path.read_text(encoding="utf-8")
        if filled(text) != text:
            path.write_text(filled(text), encoding="utf-8")
            print(path)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))
