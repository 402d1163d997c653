"""What a kind of rig is stands in its declaration: code asks that, and does not know kinds by their names."""

import re
from collections.abc import Mapping
from typing import Final

from models.rigs.kinds import KINDS
from tests.places import ROOT

DECLARED: Final = ("models/rigs", "models/effects", "controller/drives.py", "plant/hidden/registry.py")
"""Where names of kinds belong: their declarations, the effects' and the registries of controller and plant."""
LEFT: Final[Mapping[str, str]] = {
    "hil/api.py": "an example in a docstring",
    "hil/app/demo/example.py": "the rig files that the demo writes",
    "models/drives/coil.py": "a drive's own name",
    "models/drives/magnetic.py": "a drive's own name",
    "models/drives/pull.py": "a drive's own name",
    "models/drives/vibro.py": "a drive's own name",
    "models/identification/verdict.py": "the id of a check",
}
"""Files beside those that have a kind's name in quotes, each with what it is there; take a line out, add none."""


def test_no_other_file_knows_a_kind_by_its_name() -> None:
    named = re.compile(rf"""(["'])({"|".join(KINDS)})\1""")
    files = [path for room in ("controller", "models", "plant", "hil") for path in (ROOT / room).rglob("*.py")]
    found = {str(path.relative_to(ROOT)) for path in files if named.search(path.read_text(encoding="utf-8"))}
    assert {path for path in found if not path.startswith(DECLARED)} == set(LEFT)
