"""What a report says of a capsule's time series: equations, sentences, and the experiment that would tell effects
apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from models.assembly.step import Surface
from models.drives.coil import Coil, VoltageCoil
from models.drives.drive import Drive
from models.drives.magnetic import Magnetic
from models.drives.vibro import Vibro, VoltageVibro
from models.effects import BY_ID
from models.effects.equation import lines_of
from models.effects.refinements.level_at_onset import LevelAtOnset
from models.files.record import Record
from models.identification.kind import Theta
from models.identification.kinds.series.kind import SeriesKind
from models.identification.kinds.series.simulation import active_effects
from models.surfaces.plate import Plate

_FORESIGHTS = (
    (0.03, "one step ahead of an observer that forgets within 0.03 s"),
    (0.5, "ahead of an observer that forgets within half a second"),
    (None, "in a free run"),
)
_SPARED = f"{LevelAtOnset.id}.spared"
_GUT = "m a = F_act - F_e(|v|) Sgn(v) - F_v(w) - T(u)"


def equations(kind: SeriesKind, theta: Theta) -> list[str]:
    """The model in words and numbers."""
    p = {**kind.nominal(), **theta}
    lines = [*_surface_lines(kind.surface, p), *_drive_lines(kind.drive, p)]
    return [*lines, *lines_of([BY_ID[name] for name in active_effects(theta)], theta)]


def _surface_lines(surface: Surface, p: Theta) -> list[str]:
    if isinstance(surface, Plate):
        return [f"m a = F_act - {p['friction_coefficient']:.4g} N Sgn(v), N the weight of all that lies on the plate"]
    return [
        _GUT,
        f"F_e = {p['hoop_stress_factor']:.4g} sin(theta) I1(|v|)",
        f"f_c = {p['friction_coefficient']:.4g} (m g + {p['hoop_stress_factor']:.4g} (cos(theta) I1(|v|) + I2(|v|)))",
        "stick: u' = v until |T(u)| = f_c; slip: u' = -v_i, v_i = u_c/t_r, until u = 0",
    ]


def _drive_lines(drive: Drive, p: Theta) -> list[str]:
    if isinstance(drive, Magnetic):
        return [f"F_act = {p['magnet_stiffness_N_per_m']:.4g} g/(1 + (g/r)^2)^2, g = carriage - capsule"]
    if isinstance(drive, Coil):
        field = "" if drive.range_m is None else "/(1 + ((x - x_c)/r)^2)^2"
        lines = [f"F_act = {p['coil_force_N_per_A']:.4g} i{field}"]
        return [*lines, *(_current_line(p, "v") if isinstance(drive, VoltageCoil) else ())]
    if isinstance(drive, Vibro):
        reaction = " - F" if drive.reaction_on_body else ""
        force = f"{p['coil_force_N_per_A']:.4g} i" if isinstance(drive, VoltageVibro) else f"{p['force_N']:.4g} on"
        return [
            (
                f"F_act = S{reaction}, S = {p['spring_stiffness_N_per_m']:.4g} r + {p['spring_damping_N_s_per_m']:.4g}"
                " r' + stops"
            ),
            f"{drive.inner_mass_kg:.4g} w' = F - S, F = {force}",
            *(_current_line(p, "r'") if isinstance(drive, VoltageVibro) else ()),
        ]
    return []


def _current_line(p: Theta, speed: str) -> tuple[str]:
    return (f"L i' = U - {p['coil_resistance_ohm']:.4g} i - {p['back_emf_V_s_per_m']:.4g} {speed}",)


def statements(kind: SeriesKind, theta_by_stage: Mapping[str, Theta], records: Sequence[Record]) -> list[str]:
    """Sentences for the report: about the sensor and the drive, and the error over short, middle and unlimited
    foresight. Short ones tell nothing of a kind with `free_only`: an observer that follows the noise of a position is
    thrown out of step by it.
    """
    said = about_the_rig(kind.drive, kind.noise_std, kind.unit, theta_by_stage["augmented"])
    for memory, words in _FORESIGHTS[1:] if kind.free_only else _FORESIGHTS:
        rms = (
            f"{kind.foresight_rms(records, theta, memory):.3g} {kind.unit} {stage}"
            for stage, theta in theta_by_stage.items()
        )
        said.append(f"Rms on the training records, {words}: {', '.join(rms)}.")
    return said


def about_the_rig(drive: Drive, noise_std: float, unit: str, theta: Theta) -> list[str]:
    """Sentences on the sensor and on what the drive leaves untold."""
    said = [f"Noise of the sensor: {noise_std:.3g} {unit}."]
    if _SPARED in theta:
        nose, pressed = (f"{100 * min(max(1 + side * theta[_SPARED], 0.0), 1.0):.0f} %" for side in (1, -1))
        said.append(
            f"Of the changed resistance the nose feels {nose} (F_e), what the wall presses on the slip limit {pressed}"
            " (f_c)."
        )
    if isinstance(drive, Magnetic):
        said.append(
            "Only the ratios of hoop stress, friction and magnet stiffness show well in a position: the three may move"
            " together."
        )
    elif not drive.imposed:
        said.append("Predictions start at the place where the record starts: the drive alone does not tell it.")
    if isinstance(drive, VoltageCoil | VoltageVibro):
        said.append(
            "Of the coil's resistance and its force per current a position shows the ratio alone: the resistance is"
            " believed."
        )
    return said


def next_experiment(kind: SeriesKind, theta: Theta, records: Sequence[Record]) -> str | None:
    """What would separate each effect from those confounded with it."""
    effects = active_effects(theta)
    if not effects:
        return None
    return "; ".join(
        f"{name} against {', '.join(BY_ID[name].confounders)}: {BY_ID[name].separated_by}" for name in effects
    )
