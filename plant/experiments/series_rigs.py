"""The rigs of made-up experiments: what their experimenter believes, what is true, what drives them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Final

import numpy as np

from models.laws.geometry import Capsule
from plant.drives.kinds import TrueCoil, TrueMagnet, TruePull, TrueVibro
from plant.experiments.excitation import random_runs
from plant.experiments.profile import Profile, RandomPulses, RandomRuns, RandomVoltage, Wander
from plant.rig import TruePlate, Truth
from plant.tables import Floats

FINE_STEP_S: Final = 5e-6
"""Step of the plant: an error at a single edge of the switch stays in the position to the end, so it must lie below the
noise.
"""


@dataclass(frozen=True)
class Believed:
    """One made-up rig: its nominal numbers, how it is driven, which columns of its records are not logged, what shares
    of nominal its force and spring may be. A `plain` one draws a record from one stream of random numbers, and its rig
    file has no table `[surface]`.
    """

    nominal: Truth
    profile: Profile
    unlogged: tuple[str, ...] = ()
    shares: tuple[float, float] = (0.93, 1.07)
    plain: bool = False

    @property
    def kind(self) -> str:
        """Its kind in a rig file."""
        return self.nominal.drive.kind

    @property
    def pulled(self) -> bool:
        """Whether its force is measured, not its position."""
        return isinstance(self.nominal.drive, TruePull)

    def truth(self, rng: np.random.Generator) -> Truth:
        """A rig whose hoop stress and friction differ from nominal by up to 15 %, force and spring within `shares`."""
        hoop, friction = (float(rng.uniform(0.85, 1.15)) for _ in range(2))
        force, spring = (float(rng.uniform(*self.shares)) for _ in range(2))
        rig, drive, plate = self.nominal, self.nominal.drive, self.nominal.surface
        drive = drive.varied(force, spring)
        if plate is not None:
            return replace(rig, drive=drive, surface=TruePlate(plate.friction_coefficient * friction))
        tissue = replace(rig.tissue, friction_coefficient=rig.tissue.friction_coefficient * friction)
        return replace(rig, drive=drive, tissue=tissue, hoop_factor=hoop)

    def tables(self) -> list[str]:
        """Lines of the rig file from `[rig]` on, `[surface]` among them."""
        drive, plate = self.nominal.drive, self.nominal.surface
        surface: Mapping[str, object] = (
            {"kind": "gut"} if plate is None else {"kind": "plate", "friction_coefficient": plate.friction_coefficient}
        )
        below = [] if self.plain else _table("surface", surface)
        rig: dict[str, object] = {"kind": self.kind}
        if isinstance(drive, TrueCoil):
            rig["force_constant_N_per_A"] = drive.gain_N_per_A
            if self.unlogged:
                rig |= {"coil_resistance_Ohm": drive.resistance_ohm, "coil_inductance_H": drive.inductance_H}
                rig["current_limit_A"] = drive.current_limit_A
        elif isinstance(drive, TrueVibro):
            names = ("inner_mass_kg", "spring_stiffness_N_per_m", "spring_damping_N_s_per_m", "force_N")
            below = [*_table("drive", {n: getattr(drive, n) for n in (*names, "reaction_on_body")}), *below]
        elif not self.pulled:
            rig |= asdict(drive)
        return [*_table("rig", rig), *below]


def _table(name: str, values: Mapping[str, object]) -> list[str]:
    """A TOML table and an empty line before it."""
    words = {True: "true", False: "false"}
    rows = (words[v] if isinstance(v, bool) else f'"{v}"' if isinstance(v, str) else repr(v) for v in values.values())
    return ["", f"[{name}]", *(f"{key} = {row}" for key, row in zip(values, rows, strict=True))]


class _WholeRuns(RandomRuns):
    """The same to the end of the last pair of runs."""

    def values(self, duration_s: float, dt: float, rng: np.random.Generator) -> Floats:
        return random_runs(rng, duration_s, dt)


_LIGHT, _SLIPPERY, _HEAVY = Capsule(mass_kg=0.02), TruePlate(0.29), Capsule(mass_kg=0.193)
_COIL: Final = TrueCoil(back_emf_V_s_per_m=0.0)
BELIEVED: Final = {
    TruePull.kind: Believed(Truth(TruePull()), _WholeRuns(), shares=(0.95, 1.05), plain=True),
    TrueMagnet.kind: Believed(Truth(TrueMagnet()), Wander(), shares=(0.95, 1.05), plain=True),
    TrueCoil.kind: Believed(Truth(_COIL, step_s=FINE_STEP_S), RandomVoltage()),
    "coil_voltage": Believed(Truth(TrueCoil(), step_s=FINE_STEP_S), RandomVoltage(), ("coil_current_A",)),
    TrueVibro.kind: Believed(Truth(TrueVibro(0.01, 150.0, 0.2, 0.5), _LIGHT, step_s=FINE_STEP_S), RandomPulses(0.055)),
    "vibro_plate": Believed(
        Truth(TrueVibro(0.074, 256.23, 0.3, 1.25), _HEAVY, surface=_SLIPPERY, step_s=FINE_STEP_S), RandomPulses(0.08)
    ),
    "magnetic_plate": Believed(Truth(TrueMagnet(), _LIGHT, surface=_SLIPPERY), Wander()),
    "coil_plate": Believed(Truth(_COIL, _LIGHT, surface=_SLIPPERY, step_s=FINE_STEP_S), RandomVoltage(1.0)),
}
