"""The settings of a room: every threshold with its unit, its meaning and what it was chosen on."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Setting:
    """A number or a tuple of them; "1" is the unit of a bare number."""

    value: Any
    unit: str
    meaning: str
    chosen_on: str = "by hand"


class Settings:
    """The settings in `settings.toml` beside `file`: their values as attributes, all of each in `told`."""

    def __init__(self, file: str) -> None:
        tables = tomllib.loads(Path(file).with_name("settings.toml").read_text(encoding="utf-8"))
        self.told = {name: Setting(_fixed(table.pop("value")), **table) for name, table in tables.items()}
        vars(self).update({name: one.value for name, one in self.told.items()})

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"settings have no {name!r}")


def _fixed(value: Any) -> Any:
    return tuple(map(_fixed, value)) if isinstance(value, list) else value
