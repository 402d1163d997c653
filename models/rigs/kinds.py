"""The kinds of rig by their names in a rig file."""

from typing import Final

from models.rigs.axis import AXIS
from models.rigs.coil import COIL
from models.rigs.dma import DMA
from models.rigs.friction import FRICTION
from models.rigs.kind import RigKind
from models.rigs.magnetic import MAGNETIC
from models.rigs.periods import PERIODS
from models.rigs.pull import PULL
from models.rigs.vibro import VIBRO
from models.rigs.vibro_table import VIBRO_TABLE

KINDS: Final[dict[str, RigKind]] = {
    kind.id: kind for kind in (PULL, MAGNETIC, COIL, VIBRO, VIBRO_TABLE, AXIS, PERIODS, FRICTION, DMA)
}
