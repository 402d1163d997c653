"""Each drive is declared once, and read by that declaration alone."""

import re
from pathlib import Path

import pytest

from controller.drives import DRIVES, driven_of
from hil.nodes.frame_map import FRAME_MAPS, frames
from models.drives.coil import Coil
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.drives.vibro import Vibro
from models.rigs.kinds import KINDS
from plant.drives import DRIVES as SIMULATED

ROOT = Path(__file__).parents[2]
NAMED = re.compile(r"""["'](pull|magnetic|coil|vibro|vibro_table|axis|periods|friction|dma)["']""")
REGISTRIES = ("controller/drives.py", "plant/hidden/registry.py", "hil/nodes/frame_map.py")


def test_every_drive_is_believed_simulated_and_on_the_bus() -> None:
    assert set(DRIVES) <= {name for name, kind in KINDS.items() if kind.of_capsule}
    assert set(DRIVES) <= set(SIMULATED)
    assert set(DRIVES) == set(FRAME_MAPS)


@pytest.mark.parametrize("drive", [Magnetic(), Coil(), Vibro()], ids=list(DRIVES))
def test_what_is_declared_is_what_its_model_and_its_frames_have(drive: Drive) -> None:
    driven, frame_map = driven_of(drive), FRAME_MAPS[drive.name]
    assert (driven.name, driven.placed, driven.shaken) == (drive.name, drive.anchored, drive.turning)
    assert frame_map.channel == drive.commanded
    assert {f.name for f in frames()[frame_map.command].fields} >= set(frame_map.values(0.0, 0.0, 0))
    assert {f.name for f in frames()[frame_map.feedback].fields} >= {frame_map.still}
    assert {f.name for f in frames()[frame_map.command].fields} >= {signal for signal, _ in frame_map.bounds}


def test_a_drive_that_cannot_be_led_is_refused() -> None:
    with pytest.raises(ValueError, match="drive must be magnetic, coil or vibro to be limited; got 'pull'"):
        driven_of(Pull())


@pytest.mark.parametrize(
    "room", ["controller", "plant", "hil/nodes", "hil/log", "hil/bus", "hil/app/sil", "hil/app/run"]
)
def test_no_drive_stands_in_quotes_beside_the_registries(room: str) -> None:
    files = [p for p in (ROOT / room).rglob("*.py") if p.relative_to(ROOT).as_posix() not in REGISTRIES]
    found = [(p.name, line) for p in files for line in p.read_text().splitlines() if NAMED.search(line)]
    assert [line for _, line in found if "coil's" not in line] == []
