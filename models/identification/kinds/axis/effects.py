"""Three of the catalogue's effects in the newtons and milliseconds of a linear stage."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from models.effects.effect import Effect
from models.effects.force.viscous_drag import ViscousDrag
from models.effects.friction.stribeck import Stribeck
from models.effects.sensor.sensor_delay import SensorDelay
from models.parameter import Parameter


@dataclass(frozen=True)
class AxisDrag(ViscousDrag):
    """`viscous_drag` in the newtons of a stage; exponents near 0 are a film that thins with shear."""

    grid = MappingProxyType({"exponent": (0.15, 0.3, 0.6, 1.5, 2.0)})
    probe = 1.0
    coefficient_N: Parameter = Parameter(
        "coefficient_N", 0.0, "N at 10 mm/s", -100.0, 100.0, ViscousDrag.source, fit=True
    )
    exponent: Parameter = Parameter("exponent", 0.5, "1", 0.1, 3.0, ViscousDrag.source, fit=True)


@dataclass(frozen=True)
class AxisStribeck(Stribeck):
    """`stribeck` as its name is meant: extra resistance at low speed, never less."""

    grid = MappingProxyType({"speed_m_s": (0.001, 0.003, 0.01, 0.03)})
    excess: Parameter = Parameter("excess", 0.0, "1", 0.0, 3.0, Stribeck.source, fit=True)


@dataclass(frozen=True)
class AxisDelay(SensorDelay):
    """`sensor_delay` of a position reading, milliseconds at most."""

    probe = 2e-4
    delay_s: Parameter = Parameter("delay_s", 0.0, "s", 0.0, 0.01, SensorDelay.source, fit=True)


VARIANTS: Final[tuple[type[Effect], ...]] = (AxisStribeck, AxisDrag, AxisDelay)
