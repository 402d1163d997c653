"""A drive and a surface that nobody here knows take part once they stand in the tables: one in models, one in the
controller, one in the plant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from controller.actuators import Actuator
from controller.baselines.pid import PID
from controller.drives import DRIVES as CONTROLLED
from controller.drives import Driven, envelope_of
from controller.estimator.cubature_filter import Estimator
from controller.limits import Limits
from controller.model.control_model import control_model
from controller.trajectory import by_speeds
from controller.tuned import PidGains
from models.drives.drive import Drive
from models.identification.fitting.fit import Problem, narrowing
from models.identification.kinds.series.kind import SeriesKind
from models.laws.geometry import GRAVITY, Capsule
from models.parameter import Parameter
from models.records.record import Record
from models.rigs.columns import Columns
from models.rigs.kind import RigKind
from models.rigs.kinds import KINDS
from models.rigs.parts import SURFACES, drive_of, surface_of
from models.rigs.rig import Rig
from models.rigs.tables import Surface as SurfaceTable
from models.surfaces.surface import Levels, Surface, Values
from plant.drives.kinds import DRIVES as SIMULATED
from plant.drives.kinds import Force
from plant.rig import Plant, Plate
from plant.rig import Rig as Truth
from tests.controller.loops import closed_loop

MASS_KG, THRUST, MU = 0.02, 0.8, 0.3


@dataclass(frozen=True)
class Thruster(Drive):
    """A jet that pushes with a force in proportion to its command."""

    name: ClassVar[str] = "thruster"
    commanded: ClassVar[str] = "jet"
    measured: ClassVar[str] = "position_m"

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("thrust_N", 1.0, "N", 0.5, 2.0, "data sheet", fit=True),)

    def force(self, x: Any, v: Any, command: Any, p: Mapping[str, Any]) -> Any:
        return p["thrust_N"] * command

    def command_for(self, force: Any, x: Any, v: Any, p: Mapping[str, Any]) -> Any:
        return force / p["thrust_N"]

    def equations(self, p: Mapping[str, Any]) -> list[str]:
        return [f"F_act = {p['thrust_N']:.4g} jet"]


@dataclass(frozen=True)
class Slab(Surface):
    """Coulomb friction whose coefficient is known and not fitted."""

    mass_kg: float

    @property
    def body_kg(self) -> float:
        return self.mass_kg

    def parameters(self) -> tuple[Parameter, ...]:
        return (Parameter("slab_friction", MU, "1", 0.1, 1.0, "known"),)

    def hold(
        self,
        speed: Any,
        p: Values,
        carried_kg: float = 0.0,
        levels: Levels = (1.0, 1.0, 1.0),
        pressing: Any = 0.0,
    ) -> tuple[Any, Any]:
        return p["slab_friction"] * ((self.mass_kg + carried_kg) * GRAVITY + pressing) * levels[0], 0.0

    def equations(self, p: Values) -> list[str]:
        return [f"m a = F_act - {p['slab_friction']:.4g} m g Sgn(v)"]


class Jet(Force):
    """The simulated jet: a force, and a capsule that can be led."""

    free: ClassVar[bool] = True

    @property
    def command_scale(self) -> float:
        return THRUST


def _bounds(drive: Drive, limits: Limits) -> dict[str, float]:
    return {"low": -1.0, "high": 1.0, "rate": 1e3}


THRUSTER = RigKind(
    id="thruster",
    layouts=(Columns((("jet",),), ("position_m",)),),
    drive=lambda rig, by_voltage: Thruster(),
)


@pytest.fixture
def rig(monkeypatch: pytest.MonkeyPatch) -> Rig:
    """A rig of the new kinds, which three tables and the surfaces' know of."""
    monkeypatch.setitem(KINDS, "thruster", THRUSTER)
    monkeypatch.setitem(SURFACES, "plate", lambda rig: Slab(rig.capsule.mass_kg))
    monkeypatch.setitem(CONTROLLED, "thruster", Driven(name="thruster", bounds=_bounds, actuator=Actuator))
    monkeypatch.setitem(SIMULATED, "thruster", Jet)
    capsule = Capsule(mass_kg=MASS_KG)
    return Rig("thruster", capsule, surface=SurfaceTable(kind="plate", friction_coefficient=MU))


def truth() -> Truth:
    """The simulated rig: another program, the same friction."""
    return Truth(SIMULATED["thruster"](), Capsule(mass_kg=MASS_KG), surface=Plate(MU))


def test_it_is_assembled_predicted_and_calibrated(rig: Rig) -> None:
    plant, every = Plant(truth()), 100
    t = plant.rig.step_s * np.arange(100_001)
    jet = 0.12 * np.sin(2 * np.pi * 2 * t)
    rows = plant.advance(THRUST * jet, every)
    place = np.interp(t[::every], rows[:, 0], rows[:, 1])
    record = Record("jet", "thruster", {"t_s": t[::every], "jet": jet[::every], "position_m": place})
    kind = SeriesKind.build(surface_of(rig), drive_of(rig), 1e-5, [record])
    fit = narrowing(Problem.of(kind, [record], [], kind.final), kind.nominal())
    assert fit.theta["thrust_N"] == pytest.approx(THRUST, rel=2e-3)
    assert np.std(kind.predict(record, fit.theta) - place) < 0.02 * np.std(place)


def test_it_is_led_in_closed_loop(rig: Rig) -> None:
    model = control_model(rig, {"thrust_N": THRUST}, 2e-3)
    envelope = envelope_of(model.drive)
    pid = PID(model, envelope, PidGains(20.0, 40.0, 1.0))
    reference = by_speeds([0.0, 5e-3], [0.2, 3.0])
    rows, commands, _, _ = closed_loop(model, [pid], reference, 3.0, truth(), Estimator(model))
    assert np.max(np.abs(commands)) <= 1.0
    assert rows[-1, 1] == pytest.approx(5e-3 * 2.8, abs=2e-3)


def test_a_kind_that_is_in_no_table_is_refused_with_those_that_are() -> None:
    with pytest.raises(ValueError, match="known: pull, magnetic, coil, vibro"):
        drive_of(Rig("thruster"))
    with pytest.raises(ValueError, match="must have the numbers of its drive"):
        drive_of(Rig("magnetic"))
