"""Files of deployments for tests: a rig with a bus, and the plant that stands in for it."""

from pathlib import Path

from tests.conftest import RIG

TRUTH = """
[rig]
kind = "magnetic"
magnet_stiffness_N_per_m = 24.2
magnet_range_m = 0.02
[tissue]
preset = "jejunum"
[reference]
kind = "ramp"
speed_mm_s = 2.0
"""
PLANT = f"[scenario]\nduration_s = 60.0\nseed = 1\n{TRUTH}"


def deployment(
    channel: str = "test",
    interface: str = "capsule_local",
    control: str = "duration_s = 1.0\nprobe = false",
    more: str = "",
    bus: str = "",
) -> str:
    """A rig file of a magnetic rig on a bus, with `more` tables and more lines of `[bus]`."""
    tables = (
        f'[bus]\ninterface = "{interface}"\nchannel = "{channel}"\n{bus}\n[control]\n{control}\n[reference]\nkind ='
        ' "ramp"\nspeed_mm_s = 2.0\n'
    )
    return f"{RIG}\n{tables}\n{more}"


def rig_file(folder: Path, text: str) -> str:
    """Write it into `folder`; its path."""
    path = folder / "rig.toml"
    path.write_text(text)
    return str(path)
