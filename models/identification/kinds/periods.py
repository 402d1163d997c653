"""Stick-slip of a capsule pulled at constant speeds: period, valley and peak from the wall's tension (paper A)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar

import numpy as np
import scipy

from models.effects import CATALOGUE, Catalogue
from models.effects.effect import Effect, Signals, by_name
from models.effects.wall import SmallStrainStiffening
from models.identification.kind import Array, Kind, Split, present
from models.identification.kinds.table import left_out_in_turn
from models.identification.settings import SET
from models.laws.geometry import GRAVITY, Capsule, Tissue, stretched_length, wall_section
from models.laws.hyperelastic import WallConstants, wall_tension
from models.laws.resistance import pressure_integrals
from models.laws.stick_slip import Tooth, stick_slip_tooth
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.benches import PERIODS
from models.rigs.rig import Rig
from models.theta import Theta
from models.words.sentences import listed

COLUMNS = ("period_s", "valley_N", "peak_N")
EQUIVALENTS = MappingProxyType({"small_strain_stiffening": ("wall_viscosity",)})
"""Effects that give the same period, valley and peak at any one speed."""
_HELD = "fixed: not identifiable at one speed"
_WALL = WallConstants.from_set()


class SingleSpeedStiffening(SmallStrainStiffening):
    """`small_strain_stiffening` of which one speed identifies the size alone, not the drag over which it fades."""

    grid = by_name()
    scale_m = replace(SmallStrainStiffening.scale_m, source=_HELD, fit=False)
    tail = replace(SmallStrainStiffening.tail, source=_HELD, fit=False)


@dataclass(frozen=True)
class Cycle:
    """One stick-slip cycle: its tooth, valley and peak of the force in N."""

    tooth: Tooth
    valley: float
    peak: float


@dataclass(frozen=True)
class PeriodsKind(Kind):
    """Saw-tooth between `F_e` and `F_e + f_c`: the wall sticks until `T(u_c) = f_c`, then draws back at `v_i = u_c/t_r`
    within the recovery time `t_r`.

    `F_e = q sin(theta) I1`, `f_c = mu (m g + q (cos(theta) I1 + I2))` with the hoop factor q; period `u_c/v + t_r`.
    Valley and peak identify q and mu; the period then follows from the wall's law and tests it. With a
    `return_speed_m_s` v_i the fall is paper A's, `u_c/(v + v_i)`, at any speed.
    """

    capsule: Capsule
    tissue: Tissue
    velocity_m_s: float
    base: tuple[Parameter, ...]
    length_m: float
    return_speed_m_s: float | None = None
    scatter: tuple[float, float, float] = SET.period_scatter
    period_std_s: float | None = None
    effects: tuple[type[Effect], ...] = field(default_factory=lambda: single_speed_effects())
    name: str = PERIODS.id
    catalogue: Catalogue = CATALOGUE
    next_share: ClassVar[float] = SET.table_next
    quantities: tuple[str, ...] = ("period_s", "valley_N", "peak_N")
    quantity: str = listed(quantities)
    unit: str = "s, N, N"
    error_unit: str = "%"
    equivalents: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: EQUIVALENTS)
    measure: str = "rms of the relative errors of the mean period, valley and peak"

    @classmethod
    def from_rig(cls, rig: Rig, records: Sequence[Record] = ()) -> PeriodsKind:
        """The pull that a rig file describes; `records` of several speeds allow the effects that need several."""
        mu, catalogue = rig.tissue.friction_coefficient, Catalogue.of(rig)
        hoop = "common factor on the hoop stress, differs from rig to rig"
        base = (
            Parameter("hoop_factor", 1.0, "1", 0.02, 50.0, hoop, fit=True),
            Parameter("friction_coefficient", mu, "1", min(1e-3, mu), max(1.0, mu), "rig file", fit=True),
        )
        speed = SET.pull_m_s if rig.velocity_m_s is None else abs(rig.velocity_m_s)
        kind = cls(rig.capsule, rig.tissue, speed, base, stretched_length(rig.capsule), catalogue=catalogue)
        kind = replace(kind, period_std_s=rig.noise.period_std_s, effects=single_speed_effects(catalogue))
        speeds = kind.speeds_of(records)
        if len(speeds) < 2:
            return replace(kind, velocity_m_s=float(speeds[0])) if len(speeds) else kind
        return replace(kind, effects=catalogue.acting_on(PERIODS.id), equivalents=MappingProxyType({}))

    def measured(self, record: Record) -> Array:
        return np.column_stack([record[c] for c in COLUMNS])

    def predict(self, record: Record, theta: Theta) -> Array:
        """Period in s, valley and peak in N, one row a period."""
        speeds = self._speeds(record)
        cycles = {v: self.cycle(float(v), theta) for v in np.unique(speeds)}
        return np.array([[cycles[v].tooth.period_s, cycles[v].valley, cycles[v].peak] for v in speeds])

    def cycle(self, speed: float, theta: Theta) -> Cycle:
        """The steady cycle at a pull of `speed` in m/s."""
        resistance, limit = self.levels(speed, theta)
        tooth = self.tooth(limit, speed, theta)
        low, high = self._viscous_ends(tooth, speed, theta)
        return Cycle(tooth, resistance + low, resistance + limit + high)

    def levels(self, speed: float, theta: Theta) -> tuple[float, float]:
        """Environmental resistance `F_e` and Coulomb limit `f_c` in N."""
        q, mu = theta["hoop_factor"], theta["friction_coefficient"]
        nose, cylinder = (q * float(i) for i in pressure_integrals(speed, self.capsule, self.tissue))
        load = self.capsule.mass_kg * GRAVITY + math.cos(self.tissue.theta) * nose + cylinder
        return math.sin(self.tissue.theta) * nose, mu * load

    def speeds_of(self, records: Sequence[Record]) -> Array:
        """The speeds of the pull in m/s, each once, rising."""
        return np.unique(np.concatenate([self._speeds(r) for r in records])) if records else np.zeros(0)

    def tension(self, drag: float, speed: float, theta: Theta) -> float:
        """Elastic wall tension in N at a drag in m and a pull in m/s, with the effects in `theta`."""
        out = float(wall_tension(drag, _WALL, wall_section(self.capsule, self.tissue), self.length_m))
        s = Signals(drag=drag, drag_rate=speed, v=speed, direction=1.0)
        return out * math.prod(float(effect.stiffening(s, p, {})) for effect, p in present(self.effects, theta))

    def viscous(self, drag: float, rate: float, speed: float, theta: Theta) -> float:
        """Force in N beyond the tension, of a wall whose drag in m grows at `rate` in m/s under a pull at `speed`."""
        s = Signals(drag=drag, drag_rate=rate, v=speed, direction=1.0)
        return sum(float(effect.wall_force(s, p, {})) for effect, p in present(self.effects, theta))

    def tooth(self, limit: float, speed: float, theta: Theta) -> Tooth:
        """Rise and fall between slip at the tension `limit` in N and rest. Raises ValueError where no drag gives it."""
        recoil = self.return_speed_m_s
        try:
            tooth = stick_slip_tooth(lambda u: self.tension(u, speed, theta), limit, speed, recoil or 1.0)
        except ValueError:
            rule = "force must rise from valley to peak by a tension that the wall can reach at the pull's speed"
            raise ValueError(f"{rule}; got {limit:g} N at {speed:g} m/s") from None
        return tooth if recoil is not None else Tooth(tooth.drag_m, tooth.rise_s, self.tissue.recovery_time_s)

    def residual(self, record: Record, theta: Theta, criterion: int = 0) -> Array:
        """Errors of period, valley and peak in units of one period's scatter, three a row.

        The predicted period is the wall law's at the *measured* height of the teeth: valley and peak identify q and mu,
        the period tests the law. At the fitted height a wrong law would hide in wrong forces.
        """
        measured, predicted = self.measured(record), self.predict(record, theta)
        speeds = self._speeds(record)
        for v in np.unique(speeds):
            rows = speeds == v
            height = float(np.mean(measured[rows, 2] - measured[rows, 1]))
            predicted[rows, 0] = self.tooth(self._limit(height, float(v), theta), float(v), theta).period_s
        return ((measured - predicted) / self._std(record)).ravel()

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        """Rms over speeds and over period, valley and peak of the relative error of the mean, in %."""
        predicted = self._by_speed(records, list(predictions))
        off = [relative_errors(measured, p) for measured, p in zip(self._by_speed(records), predicted, strict=True)]
        return 100 * float(np.sqrt(np.mean(np.square(off))))

    def noise_floor(self, records: Sequence[Record]) -> float:
        """Standard error of the means through the same measure."""
        squares = []
        for same in self._by_speed(records):
            scatter = same.std(0, ddof=1) / same.mean(0) if len(same) > 2 else np.array(self.scatter)
            squares.append(np.mean(scatter**2) / len(same))
        return 100 * float(np.sqrt(np.mean(squares)))

    def imitate(self, record: Record, theta: Theta, rng: np.random.Generator) -> Record:
        """As many periods of the model, with the relative scatter of measured ones."""
        made = self.predict(record, theta)
        ideal = record.with_columns(dict(zip(COLUMNS, made.T, strict=True)))
        made = made + self._std(ideal) * rng.standard_normal((len(record), 3))
        return record.with_columns(dict(zip(COLUMNS, made.T, strict=True)))

    def splits(self, records: Sequence[Record]) -> list[Split]:
        """Periods left out in turn, a quarter of each speed at a time, neighbours in different parts."""
        turns = np.concatenate([_turns(self._speeds(r)) for r in records])
        return [split for split in left_out_in_turn(records, np.arange(len(turns)), turns) if split[0]]

    def signals(self, record: Record) -> dict[str, Array]:
        period, valley, peak = self.measured(record).T
        return {
            "period_index": np.arange(1.0, len(record) + 1),
            "velocity_m_s": self._speeds(record),
            "valley_N": valley,
            "rise_N": peak - valley,
            "period_s": period,
        }

    def columns(self, record: Record, predicted: Array) -> dict[str, Array]:
        speed = {"velocity_m_s": record["velocity_m_s"]} if "velocity_m_s" in record.columns else {}
        return speed | dict(zip(COLUMNS, predicted.T, strict=True))

    def _speeds(self, record: Record) -> Array:
        return np.abs(record.columns.get("velocity_m_s", np.full(len(record), self.velocity_m_s)))

    def _by_speed(self, records: Sequence[Record], values: Sequence[Array] = ()) -> list[Array]:
        """The measured rows of `records`, or their `values`, by speed."""
        rows = np.concatenate(values or [self.measured(r) for r in records])
        speeds = np.concatenate([self._speeds(r) for r in records])
        return [rows[speeds == v] for v in np.unique(speeds)]

    def _viscous_ends(self, tooth: Tooth, speed: float, theta: Theta) -> tuple[float, float]:
        """What the wall's viscosity adds to valley and peak in N."""
        recoil = tooth.drag_m / tooth.fall_s if self.return_speed_m_s is None else self.return_speed_m_s
        low = min(self.viscous(0.0, speed, speed, theta), self.viscous(0.0, -recoil, speed, theta))
        return low, self.viscous(tooth.drag_m, speed, speed, theta)

    def _limit(self, height: float, speed: float, theta: Theta) -> float:
        """Coulomb limit in N of teeth of a measured height in N, without the part of the wall's viscosity."""

        def over(limit: float) -> float:
            low, high = self._viscous_ends(self.tooth(limit, speed, theta), speed, theta)
            return limit + high - low - height

        least, most = 1e-3 * height, height
        if over(most) <= 0:
            return most
        return least if over(least) >= 0 else float(scipy.optimize.brentq(over, least, most, xtol=1e-12))

    def _std(self, record: Record) -> Array:
        """Standard deviations (n, 3) of one period, valley and peak at the speed of each row."""
        measured, speeds = self.measured(record), self._speeds(record)
        std = np.empty_like(measured)
        for v in np.unique(speeds):
            std[speeds == v] = np.array(self.scatter) * np.abs(measured[speeds == v].mean(0))
        if self.period_std_s is not None:
            std[:, 0] = self.period_std_s
        return std


def single_speed_effects(catalogue: Catalogue = CATALOGUE) -> tuple[type[Effect], ...]:
    """The candidates of pulls at one speed."""
    known = catalogue.acting_on(PERIODS.id, (SingleSpeedStiffening,))
    return tuple(effect for effect in known if "speeds" not in effect.needs)


def _turns(speeds: Array) -> Array:
    """0, 1, 2, 3, 0, ... along the rows of each speed."""
    out = np.zeros(len(speeds), dtype=int)
    for v in np.unique(speeds):
        out[speeds == v] = np.arange(np.count_nonzero(speeds == v)) % 4
    return out


def relative_errors(measured: Array, predicted: Array) -> Array:
    """Relative errors of the mean period, valley and peak, shape (3,)."""
    return np.asarray(predicted.mean(0) / measured.mean(0) - 1)
