"""A table of mean speeds of a body with an inner mass on a plate, one row a run at (period, duty), and its effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np

from models.assembly.model import assemble
from models.compiled.cycles import Cycles
from models.drives.vibro import Vibro, unloaded
from models.effects import CATALOGUE, Catalogue
from models.effects.drive import ActuatorLag
from models.effects.effect import Effect, by_name, number
from models.effects.force import ViscousDrag
from models.effects.friction import DirectionalAsymmetry, Stribeck
from models.effects.inner_mass import EndStopImpact, SpringHardening
from models.identification.kind import Array, Split
from models.identification.kinds.table import TableKind, distinct, left_out_in_turn
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.benches import VIBRO_TABLE
from models.rigs.rig import Rig
from models.surfaces.surface import Plate
from models.theta import Theta


class SwitchLag(ActuatorLag):
    """`actuator_lag` of a coil that is switched on and off, milliseconds."""

    kinds = frozenset({VIBRO_TABLE.id})
    probe = 0.002
    confounders = ("coil_lag", "coil_reach", "incline_gravity")
    time_s = number(0.0, "s", 0.0, 0.015)


class SoftStop(EndStopImpact):
    """`end_stop_impact` of elastic rubber: mean speeds hardly show a short impact."""

    grid = by_name(gap_m=(0.005, 0.01, 0.015))
    stiffness_N_per_m = number(0.0, "N/m", 0.0, 3000.0, "rubber stops")
    gap_m = number(0.01, "m", 0.003, 0.03, "travel of the inner mass")
    loss_s = number(0.0, "s", 0.0, 5e-3, fit=False)


class Duffing(SpringHardening):
    """`spring_hardening` with the third power, the only one that mean speeds identify."""

    power = number(3.0, "1", 1.5, 5.0, fit=False)


class PlateDrag(ViscousDrag):
    """`viscous_drag` of a plate, never negative: a body would run away."""

    coefficient_N = number(0.0, "N at 10 mm/s", 0.0, 0.3)


class PlateStribeck(Stribeck):
    """`stribeck` of a dry plate: it fades over speeds of the body's own swing, up to 0.15 m/s."""

    grid = by_name(speed_m_s=(0.01, 0.03, 0.08))
    excess = number(0.0, "1", 0.0, 2.0)
    speed_m_s = number(0.03, "m/s", 0.002, 0.15)
    exponent = number(2.0, "1", 0.5, 4.0, fit=False)


class PlateAsymmetry(DirectionalAsymmetry):
    """`directional_asymmetry` of a plate."""

    asymmetry = number(0.0, "1", -0.4, 0.4, "directional friction of dry contacts: tens of percent")


VARIANTS: Final[tuple[type[Effect], ...]] = (SwitchLag, SoftStop, Duffing, PlateStribeck, PlateDrag, PlateAsymmetry)


@lru_cache(maxsize=256)
def _cycles(body_kg: float, inner_kg: float, reaction_on_body: bool, effects: tuple[type[Effect], ...]) -> Cycles:
    drive = Vibro(inner_mass_kg=inner_kg, reaction_on_body=reaction_on_body)
    return Cycles(assemble(Plate(body_kg), drive, effects))


@dataclass(frozen=True)
class VibroTableKind(TableKind):
    """Mean speed over `cycles` periods from rest, `M v' = S - F - mu (M + m) g Sgn(v)`, `m (v' + xi'') = F - S`, `S = k
    xi`.

    One residual a condition (period, duty, cycles): the mean of its repeats against the model, in units of `sqrt(s^2/n
    + model_error_m_s^2)` with the repeats' scatter s, softened for outliers. The mirror, +1 or -1, is the sign with
    which the record counts velocities; `settled` chooses it from records, once.
    """

    base: tuple[Parameter, ...]
    reaction_on_body: bool = True
    model_error_m_s: float = 2.0e-3
    effects: tuple[type[Effect], ...] = field(default_factory=lambda: CATALOGUE.acting_on(VIBRO_TABLE.id, VARIANTS))
    name: str = VIBRO_TABLE.id
    catalogue: Catalogue = CATALOGUE
    quantity: str = "mean_velocity_m_s"
    unit: str = "m/s"
    measure: str = "rms error of the mean velocity over the conditions, each the mean of its repeats"

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record] = ()) -> VibroTableKind:
        """The kind of a rig with a drive and a plate, `settled` by `records`. Raises ValueError for another rig."""
        drive, surface = rig.drive, rig.surface
        if drive is None or surface is None or surface.kind != "plate" or surface.friction_coefficient is None:
            raise ValueError(
                f"rig must have a drive and a plate for kind {VIBRO_TABLE.id!r}; got kind {rig.kind!r} without them"
            )

        masses = ("body_mass_kg", rig.capsule.mass_kg, "kg"), ("inner_mass_kg", drive.inner_mass_kg, "kg")
        fixed = (("force_N", drive.force_N, "N"), *masses)
        scale = "common factor of force and friction, as a wrong force, masses or scale of the displacement make it"
        base = (
            Parameter.near("spring_stiffness_N_per_m", drive.spring_stiffness_N_per_m, "N/m", 0.8, 1.2, "rig file"),
            Parameter("load_scale", 1.0, "1", 0.25, 4.0, scale, fit=True),
            Parameter.near("friction_coefficient", surface.friction_coefficient, "1", 0.5, 1.7, "rig file"),
            *(Parameter(name, value, unit, value, value, "rig file") for name, value, unit in fixed),
            Parameter("mirror", 1.0, "1", -1.0, 1.0, "settled once from the records"),
        )
        made = cls(base, drive.reaction_on_body)
        if rig.noise.velocity_std_m_s is not None:
            made = replace(made, model_error_m_s=rig.noise.velocity_std_m_s)
        return made.settled(records) if records and made.quantity in records[0].columns else made

    def keys(self, record: Record) -> Array:
        return np.column_stack((record["period_s"], record["duty"], record["cycles"]))

    def settled(self, records: Sequence[Record]) -> VibroTableKind:
        """The same kind with the mirror for which models with some damping fit the records best."""
        ratios = (0.02, 0.05, 0.1, 0.2)
        scale = 2 * float(np.sqrt(self.nominal()["spring_stiffness_N_per_m"] * self.nominal()["inner_mass_kg"]))
        lost = {}
        for mirror in (1.0, -1.0):
            trials = [Theta({"mirror": mirror}, {"spring_damping": {"damping_N_s_per_m": r * scale}}) for r in ratios]
            lost[mirror] = min(self.error(records, [self.predict(r, t) for r in records]) for t in trials)
        best = min(lost, key=lambda mirror: lost[mirror])
        return replace(self, base=tuple(p.at(best) if p.name == "mirror" else p for p in self.base))

    def predict(self, record: Record, theta: Theta) -> Array:
        """Mean velocity in m/s, one a row, from `period_s`, `duty` and `cycles`."""
        values = self.nominal() | theta
        runs, index = self.conditions(record)
        acting = tuple(effect for effect in self.effects if values.effects.get(effect.id))
        if strange := set(values.effects) - {effect.id for effect in acting}:
            known = ", ".join(effect.id for effect in self.effects)
            raise ValueError(
                f"effect must be one that acts on a body with an inner mass; got {min(strange)!r}; known: {known}"
            )
        masses = float(values["body_mass_kg"]), float(values["inner_mass_kg"])
        speeds = _cycles(*masses, self.reaction_on_body, acting).speeds(runs, unloaded(values))
        return np.asarray(values["mirror"] * speeds[index], dtype=float)

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """Difference of each condition's mean from the model in units of its standard deviation, as pseudo-Huber."""
        misfit = self.errors(record, self.predict(record, theta)) / np.sqrt(self.variances(record))
        return np.asarray(misfit * np.sqrt(2 / (1 + np.sqrt(1 + (misfit / SET.outlying) ** 2))))

    def scatter(self, record: Record) -> Array:
        """Standard deviation in m/s of a run: of reading the displacement, and a share of the speed by the repeats."""
        _, index = self.conditions(record)
        mean = self.means(record, record[self.quantity])[index]
        counts = np.bincount(index)
        reading = SET.reading_m / np.sqrt(12) / (record["cycles"] * record["period_s"])
        spread = np.sum((record[self.quantity] - mean) ** 2) - np.sum(reading**2 * (1 - 1 / counts[index]))
        share = max(float(spread) / max(float(np.sum(mean**2 * (1 - 1 / counts[index]))), 1e-12), 0.0)
        return np.asarray(np.sqrt(reading**2 + share * mean**2), dtype=float)

    def variances(self, record: Record) -> Array:
        """Variances of the means in m^2/s^2, one a condition: by the scatter of the runs and the error of the set-up,
        which the repeats of a condition share. The noise floor and the fit count the same.
        """
        return super().variances(record) + self.model_error_m_s**2

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """The same runs on the model, with scatter for each run and an error of the set-up for each condition."""
        runs, index = self.conditions(record)
        setup = self.model_error_m_s * rng.standard_normal(len(runs))[index]
        scatter = self.scatter(record) * rng.standard_normal(len(record))
        return record.with_column(self.quantity, self.predict(record, theta) + setup + scatter)

    def splits(self, records: Sequence[Record]) -> list[Split]:
        """Eight random parts of whole conditions (period, duty)."""
        keys = [np.column_stack((r["period_s"], r["duty"])) for r in records]
        conditions, index = distinct(np.concatenate(keys))
        part = np.random.default_rng(0).permutation(len(conditions)) % min(SET.folds, len(conditions))
        return left_out_in_turn(records, index, part)

    def signals(self, record: Record) -> dict[str, Array]:
        return {"period_s": record["period_s"], "duty": record["duty"]}

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        """The prediction as the columns of a file, one row a condition."""
        runs, _ = self.conditions(record)
        return {"period_s": runs[:, 0], "duty": runs[:, 1], self.quantity: self.means(record, predicted)}
