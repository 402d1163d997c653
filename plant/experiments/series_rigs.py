"""The rigs of made-up experiments under a coil or an inner mass, or on a plate: what their experimenter believes, what
is true, what drives them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Final

import numpy as np

from models.laws.geometry import Capsule, Tissue
from plant.drives.kinds import Coil, Magnet, Vibro
from plant.experiments.profile import Profile, RandomPulses, RandomVoltage, Wander
from plant.rig import Plate, Rig

FINE_STEP_S: Final = 5e-6
"""Step of the plant: an error at a single edge of the switch stays in the position to the end, so it must lie below the
noise.
"""


@dataclass(frozen=True)
class Believed:
    """One made-up rig: its `kind` in a rig file, its nominal numbers, how it is driven, and which columns of its
    records are not logged.
    """

    kind: str
    nominal: Rig
    profile: Profile
    unlogged: tuple[str, ...] = ()

    def truth(self, rng: np.random.Generator) -> Rig:
        """A rig whose hoop stress and friction differ from nominal by up to 15 %, force and spring by up to 7 %."""
        hoop, friction = (float(rng.uniform(0.85, 1.15)) for _ in range(2))
        force, spring = (float(rng.uniform(0.93, 1.07)) for _ in range(2))
        rig, drive, plate = self.nominal, self.nominal.drive, self.nominal.surface
        drive = drive.varied(force, spring)
        if plate is not None:
            return replace(rig, drive=drive, surface=Plate(plate.friction_coefficient * friction))
        tissue = replace(rig.tissue, friction_coefficient=rig.tissue.friction_coefficient * friction)
        return replace(rig, drive=drive, tissue=tissue, hoop_factor=hoop)

    def tables(self) -> list[str]:
        """Lines of the rig file from `[rig]` on, `[surface]` among them."""
        drive, plate = self.nominal.drive, self.nominal.surface
        surface: Mapping[str, object] = (
            {"kind": "gut"} if plate is None else {"kind": "plate", "friction_coefficient": plate.friction_coefficient}
        )
        below = _table("surface", surface)
        if isinstance(drive, Coil):
            winding: Mapping[str, object] = {
                "coil_resistance_Ohm": drive.resistance_ohm,
                "coil_inductance_H": drive.inductance_H,
                "current_limit_A": drive.current_limit_A,
            }
            rig = {"kind": self.kind, "force_constant_N_per_A": drive.gain_N_per_A}
            return [*_table("rig", {**rig, **(winding if self.unlogged else {})}), *below]
        if isinstance(drive, Magnet):
            return [*_table("rig", {"kind": self.kind, **asdict(drive)}), *below]
        assert isinstance(drive, Vibro)
        names = ("inner_mass_kg", "spring_stiffness_N_per_m", "spring_damping_N_s_per_m", "force_N", "reaction_on_body")
        head = _table("rig", {"kind": self.kind})
        return [*head, *_table("drive", {name: getattr(drive, name) for name in names}), *below]


def _table(name: str, values: Mapping[str, object]) -> list[str]:
    """A TOML table and an empty line before it."""
    words = {True: "true", False: "false"}
    rows = (words[v] if isinstance(v, bool) else f'"{v}"' if isinstance(v, str) else repr(v) for v in values.values())
    return ["", f"[{name}]", *(f"{key} = {row}" for key, row in zip(values, rows, strict=True))]


BELIEVED: Final = {
    "coil": Believed("coil", Rig(Coil(back_emf_V_s_per_m=0.0), step_s=FINE_STEP_S), RandomVoltage()),
    "coil_voltage": Believed("coil", Rig(Coil(), step_s=FINE_STEP_S), RandomVoltage(), ("coil_current_A",)),
    "magnetic_plate": Believed("magnetic", Rig(Magnet(), Capsule(mass_kg=0.02), surface=Plate(0.29)), Wander()),
    "coil_plate": Believed(
        "coil",
        Rig(Coil(back_emf_V_s_per_m=0.0), Capsule(mass_kg=0.02), surface=Plate(0.29), step_s=FINE_STEP_S),
        RandomVoltage(1.0),
    ),
    "vibro": Believed(
        "vibro",
        Rig(Vibro(0.01, 150.0, 0.2, 0.5), Capsule(mass_kg=0.02), Tissue(), step_s=FINE_STEP_S),
        RandomPulses(0.055),
    ),
    "vibro_plate": Believed(
        "vibro",
        Rig(Vibro(0.074, 256.23, 0.3, 1.25), Capsule(mass_kg=0.193), surface=Plate(0.29), step_s=FINE_STEP_S),
        RandomPulses(0.08),
    ),
}
