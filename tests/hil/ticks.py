"""The times that tests of nodes on a bus are in, in s: a controller's tick, and the slot in which a drive's firmware
runs once.
"""

from typing import Final

TICK: Final = 2e-3
SLOT: Final = 1e-3
