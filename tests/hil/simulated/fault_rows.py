"""Rows of the tests and benches that go through all faults."""

from typing import Final

from hil.simulated.faults import KINDS, LIES, MAKER

OWN_KINDS: Final = tuple(name for name, kind in KINDS.items() if kind.needs != MAKER and name not in LIES)
"""Faults that the catalogue's own drives can have, lies apart."""
MAKERS_ROWS: Final = (
    ("drop", "commands"),
    ("drop", "feedback"),
    ("killed", ""),
    ("frozen", ""),
    ("encoder_error", ""),
    ("over_temperature", ""),
    ("wrong_node", ""),
    ("wrong_bit_rate", ""),
    ("drive_reset", ""),
    ("bus_off", "controller"),
    ("late_solve", ""),
    ("drop", "all"),
    ("delay", "all"),
    ("retyped", "commands"),
    ("retyped", "feedback"),
    ("unreadable", "controller"),
    ("unreadable", "drive"),
    ("second_master", ""),
    ("player", ""),
    ("babbling", ""),
    ("bus_off", "drive"),
    ("stuck", "feedback"),
    ("biased", "localisation"),
    ("clock_jump", ""),
)
"""Faults and targets through which every drive of another maker goes."""
