"""A setting: a number that we chose, with its unit, its meaning and what it was chosen on."""

from dataclasses import field
from typing import Any


def setting(value: Any, unit: str, meaning: str, chosen_on: str = "by hand") -> Any:
    """A field of a room's record of settings; "1" is the unit of a bare number."""
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "chosen_on": chosen_on})
