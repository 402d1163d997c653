"""The vibro controller by name: from a control model with its values to a drive map, and no other drive."""

import pytest

from controller.drives import envelope_of
from controller.model.control_model import control_model
from controller.registry import build, leads
from controller.vibro import controller as leading
from controller.vibro.controller import VibroController
from controller.vibro.cycles import VibroModel
from controller.vibro.gears import DriveMap
from models.identification.model import Model
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.places import CAPSUBOT_MODEL

TABLES = {
    "capsule": {"mass_kg": 0.193},
    "drive": {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 256.23, "force_N": 1.25, "reaction_on_body": True},
    "surface": {"kind": "plate", "friction_coefficient": 0.29},
    "rig": {"kind": "vibro"},
}
IDENTIFIED = CAPSUBOT_MODEL


@pytest.fixture
def designs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[VibroModel, bool]]:
    """What drive maps are designed on, and whether with least-energy cycles; none is made."""
    asked: list[tuple[VibroModel, bool]] = []

    def remembered(model: VibroModel, optimise: bool) -> DriveMap:
        asked.append((model, optimise))
        return DriveMap((), 0.1)

    monkeypatch.setattr(leading, "designed", remembered)
    return asked


def test_the_values_of_an_identified_model_reach_the_map(designs: list[tuple[VibroModel, bool]]) -> None:
    stages = Model.from_toml(IDENTIFIED.read_text(encoding="utf-8")).stages
    values = {k: v for k, v in stages["augmented"].items() if k not in ("mirror", "body_mass_kg", "inner_mass_kg")}
    model = control_model(parse_rig(TABLES), values, 2e-3)
    chain = build("vibro", model, envelope_of(model.drive))
    assert [c.name for c in chain] == ["vibro"]
    seen = designs[0][0]
    assert seen.force_N == 3.16
    assert seen.values["spring_damping", "damping_N_s_per_m"] == 2.349
    assert {e.id for e in seen.effects} == {"spring_damping", "coil_lag"}


def test_the_baselines_go_without_the_least_energy_cycles_and_without_the_loop(
    designs: list[tuple[VibroModel, bool]],
) -> None:
    model = control_model(parse_rig(TABLES), Theta(), 2e-3)
    chains = [build(name, model, envelope_of(model.drive)) for name in ("vibro", "vibro_square", "vibro_map")]
    assert [optimise for _, optimise in designs] == [True, False, True]
    assert [c[0].tuning.feedback for c in chains if isinstance(c[0], VibroController)] == [True, True, False]


def test_each_controller_leads_its_own_drives() -> None:
    model = control_model(parse_rig(TABLES), Theta(), 1e-3)
    assert leads("vibro") == leads("vibro_square") == leads("vibro_map") == ("vibro",)
    with pytest.raises(ValueError, match="rig must be magnetic or coil for the controller 'pid'; got 'vibro'"):
        build("pid", model, envelope_of(model.drive))
