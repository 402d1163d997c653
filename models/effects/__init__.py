"""What a rig may have beyond the base model: one file an effect, and the one tuple that lists them."""

from models.effects.actuator_dead_zone import ActuatorDeadZone
from models.effects.actuator_lag import ActuatorLag
from models.effects.actuator_saturation import ActuatorSaturation
from models.effects.added_mass import AddedMass
from models.effects.back_emf import BackEmf
from models.effects.broad_relaxation import BroadRelaxation
from models.effects.carriage_backlash import CarriageBacklash
from models.effects.coil_lag import CoilLag
from models.effects.coil_reach import CoilReach
from models.effects.coupling_decay import CouplingDecay
from models.effects.coupling_fade import CouplingFade
from models.effects.damping_over_speed import DampingOverSpeed
from models.effects.directional_asymmetry import DirectionalAsymmetry
from models.effects.drying_shape import DryingShape
from models.effects.dwell_adhesion import DwellAdhesion
from models.effects.effect import Effect
from models.effects.end_stop_impact import EndStopImpact
from models.effects.exponential_recovery import ExponentialRecovery
from models.effects.fold_periodic import FoldPeriodic
from models.effects.further_lag import FurtherLag
from models.effects.further_lowpass import FurtherLowpass
from models.effects.further_relaxation import FurtherRelaxation
from models.effects.guide_friction import GuideFriction
from models.effects.incline_gravity import InclineGravity
from models.effects.level_at_creep import LevelAtCreep
from models.effects.level_at_onset import LevelAtOnset
from models.effects.level_over_speed import LevelOverSpeed
from models.effects.lumen_taper import LumenTaper
from models.effects.magnetic_hysteresis import MagneticHysteresis
from models.effects.mains_hum import MainsHum
from models.effects.peristaltic_wave import PeristalticWave
from models.effects.preconditioning import Preconditioning
from models.effects.respiration import Respiration
from models.effects.sensor_bias import SensorBias
from models.effects.sensor_delay import SensorDelay
from models.effects.sensor_drift import SensorDrift
from models.effects.sensor_lowpass import SensorLowpass
from models.effects.sensor_scale import SensorScale
from models.effects.small_strain_stiffening import SmallStrainStiffening
from models.effects.spring_damping import SpringDamping
from models.effects.spring_hardening import SpringHardening
from models.effects.stenosis import Stenosis
from models.effects.stress_relaxation import StressRelaxation
from models.effects.stribeck import Stribeck
from models.effects.string_compliance import StringCompliance
from models.effects.tissue_drying import TissueDrying
from models.effects.viscosity_thinning import ViscosityThinning
from models.effects.viscous_drag import ViscousDrag
from models.effects.wall_viscosity import WallViscosity
from models.effects.wave_harmonics import WaveHarmonics

EFFECTS: tuple[type[Effect], ...] = (
    ActuatorDeadZone,
    ActuatorLag,
    ActuatorSaturation,
    AddedMass,
    BackEmf,
    BroadRelaxation,
    CarriageBacklash,
    CoilLag,
    CoilReach,
    CouplingDecay,
    CouplingFade,
    DirectionalAsymmetry,
    DwellAdhesion,
    EndStopImpact,
    ExponentialRecovery,
    FoldPeriodic,
    GuideFriction,
    InclineGravity,
    LumenTaper,
    MagneticHysteresis,
    MainsHum,
    PeristalticWave,
    Preconditioning,
    Respiration,
    SensorBias,
    SensorDelay,
    SensorDrift,
    SensorLowpass,
    SensorScale,
    SmallStrainStiffening,
    SpringDamping,
    SpringHardening,
    Stenosis,
    StressRelaxation,
    Stribeck,
    StringCompliance,
    TissueDrying,
    ViscousDrag,
    WallViscosity,
)
REFINEMENTS: tuple[type[Effect], ...] = (
    LevelAtCreep,
    LevelAtOnset,
    LevelOverSpeed,
    DampingOverSpeed,
    DryingShape,
    FurtherLag,
    FurtherLowpass,
    FurtherRelaxation,
    ViscosityThinning,
    WaveHarmonics,
)
"""Free curves and further orders that mend the shape of a named effect; never candidates."""
BY_ID = {effect.id: effect for effect in (*EFFECTS, *REFINEMENTS)}


def effects_for(kind: str) -> tuple[type[Effect], ...]:
    """The candidates that can act on a rig of `kind`."""
    return tuple(effect for effect in EFFECTS if kind in effect.kinds)
