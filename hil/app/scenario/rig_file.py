"""RIG.toml as a rig alone: what reads the tables of a deployment is loaded only where there are any."""

from pathlib import Path

from models.files.toml import read_toml
from models.rigs.reader import parse_rig, table_names
from models.rigs.rig import Rig


def read_deployed_rig(path: Path) -> Rig:
    """The rig of a rig or deployment file. Raises ValueError of one sentence."""
    raw, _ = read_toml(path, "rig file")
    if not set(raw) <= set(table_names()):
        from hil.app.scenario.deployment import OWN_TABLES

        raw = {name: table for name, table in raw.items() if name not in OWN_TABLES}
    return parse_rig(raw, str(path))
