"""The example rigs: what their experimenter believes, what is true, what drives them, and their records."""

from dataclasses import asdict, dataclass, replace
from typing import Final

import numpy as np

from models.laws.geometry import Capsule, Tissue
from plant.drives import TrueCoil, TrueMagnet, TruePull, TrueVibro
from plant.experiments.profile import Profile, RandomPulses, RandomVoltage, Wander, WholeRuns
from plant.experiments.scenario import RunTable, Scenario, record_scenario
from plant.rig import TruePlate, Truth
from plant.sensing import Sensor
from plant.tables import Floats

FORCE_STD_N: Final = 1e-3  # noise and span of the sensors: force cell, localisation
POSITION_STD_M: Final = 5e-5
FORCE_SPAN_N: Final = 0.25
POSITION_SPAN_M: Final = 25e-3
FINE_STEP_S: Final = 5e-6  # Step for switched drives: the error of a single edge must lie below the noise


@dataclass(frozen=True)
class Believed:
    """One example rig: its nominal numbers, its profile, the columns that its records do not log, and the range of its
    force and spring as shares of nominal. A `plain` one draws a record from one stream of random numbers; its rig file
    has no table `[surface]`.
    """

    nominal: Truth
    profile: Profile
    unlogged: tuple[str, ...] = ()
    shares: tuple[float, float] = (0.93, 1.07)
    plain: bool = False

    @property
    def kind(self) -> str:
        return self.nominal.drive.kind

    @property
    def pulled(self) -> bool:
        return isinstance(self.nominal.drive, TruePull)

    def truth(self, rng: np.random.Generator) -> Truth:
        """A true rig: hoop stress and friction within 15 % of nominal, force and spring within `shares`."""
        hoop, friction = (float(rng.uniform(0.85, 1.15)) for _ in range(2))
        force, spring = (float(rng.uniform(*self.shares)) for _ in range(2))
        rig, drive, plate = self.nominal, self.nominal.drive, self.nominal.surface
        drive = drive.varied(force, spring)
        if plate is not None:
            return replace(rig, drive=drive, surface=TruePlate(plate.friction_coefficient * friction))
        tissue = replace(rig.tissue, friction_coefficient=rig.tissue.friction_coefficient * friction)
        return replace(rig, drive=drive, tissue=tissue, hoop_factor=hoop)

    def record(
        self, rig: Truth, rng: np.random.Generator, duration_s: float, noise: float = 1.0, rate_Hz: float = 500.0
    ) -> dict[str, Floats]:
        """A record of `rig`, one of its truths, in the logged columns; `noise` times the usual sensor noise."""
        std, span = (FORCE_STD_N, FORCE_SPAN_N) if self.pulled else (POSITION_STD_M, POSITION_SPAN_M)
        run = RunTable("", duration_s, 0 if self.plain else int(rng.integers(2**31)), rig.step_s)
        scenario = Scenario(run, self.kind, rig, self.profile, Sensor(rate_Hz, noise * std, span=span))
        columns = record_scenario(scenario, rng if self.plain else None)
        return {name: values for name, values in columns.items() if name not in self.unlogged}

    def tables(self, noise: float = 1.0) -> dict[str, dict[str, object]]:
        """The tables of the rig file: nominal values, `noise` times the usual noise."""
        drive, plate, capsule = self.nominal.drive, self.nominal.surface, self.nominal.capsule
        tables: dict[str, dict[str, object]] = {"capsule": {"mass_kg": capsule.mass_kg}}
        if plate is None:
            tables["capsule"] |= {"radius_m": capsule.radius_m, "cylinder_length_m": capsule.cylinder_length_m}
            tables["tissue"] = {"preset": "jejunum", **asdict(Tissue())}
        rig = tables["rig"] = {"kind": self.kind}
        if isinstance(drive, TrueCoil):
            rig["force_constant_N_per_A"] = drive.gain_N_per_A
            if self.unlogged:
                rig |= {"coil_resistance_Ohm": drive.resistance_ohm, "coil_inductance_H": drive.inductance_H}
                rig["current_limit_A"] = drive.current_limit_A
        elif isinstance(drive, TrueVibro):
            names = ("inner_mass_kg", "spring_stiffness_N_per_m", "spring_damping_N_s_per_m", "force_N")
            tables["drive"] = {name: getattr(drive, name) for name in (*names, "reaction_on_body")}
        elif not self.pulled:
            rig |= asdict(drive)
        if plate is not None:
            tables["surface"] = {"kind": "plate", "friction_coefficient": plate.friction_coefficient}
        elif not self.plain:
            tables["surface"] = {"kind": "gut"}
        name, std = ("force_std_N", FORCE_STD_N) if self.pulled else ("position_std_m", POSITION_STD_M)
        return tables | {"noise": {name: noise * std}}


_LIGHT, _SLIPPERY, _HEAVY = Capsule(mass_kg=0.02), TruePlate(0.29), Capsule(mass_kg=0.193)
_COIL: Final = TrueCoil(back_emf_V_s_per_m=0.0)
BELIEVED: Final = {
    TruePull.kind: Believed(Truth(TruePull()), WholeRuns(), shares=(0.95, 1.05), plain=True),
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
