"""The kinds of rig by their names in a rig file."""

from typing import Final

from models.rigs.benches import AXIS, DMA, FRICTION, PERIODS, VIBRO_TABLE
from models.rigs.capsules import COIL, MAGNETIC, PULL, VIBRO
from models.rigs.kind import RigKind

KINDS: Final[dict[str, RigKind]] = {
    kind.id: kind for kind in (PULL, MAGNETIC, COIL, VIBRO, VIBRO_TABLE, AXIS, PERIODS, FRICTION, DMA)
}
