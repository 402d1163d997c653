"""A table of friction over speed and load: what is found in laws that are not the catalogue's, and what is refused."""

from collections.abc import Callable

import numpy as np
import pytest

from hil import api
from hil.report.words import interpolation
from models.identification.finding import Finding
from models.identification.kinds import kind_for
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta

V, N = (np.repeat(a.ravel(), 3) for a in np.meshgrid(np.geomspace(2e-4, 2e-2, 12), (0.1, 0.2, 0.5)))
MU = 0.09 * N
Law = Callable[[], np.ndarray]
LAWS: dict[str, Law] = {
    "none": lambda: MU,
    "rational Stribeck": lambda: MU * (1 + 0.5 / (1 + (V / 2e-3) ** 1.5)),
    "minimum": lambda: MU * (1 + 0.6 / (1 + (V / 8e-4) ** 2)) + 0.012 * np.sqrt(V / 0.02),
    "adhesion": lambda: 0.09 * (N + 0.06),
    "soft contact": lambda: MU * (N / 0.2) ** (-1 / 3),
    "ripples": lambda: MU * (1 + 0.1 * np.sin(6 * np.log(V))),
}


def table(force: np.ndarray, seed: int = 0, scatter: float = 0.02, **columns: np.ndarray) -> Record:
    noise = 1 + scatter * np.random.default_rng(seed).standard_normal(V.size)
    return Record("table", "friction", {"velocity_m_s": V, "load_N": N, "force_N": force * noise, **columns})


def found(record: Record, **contact: float) -> Finding:
    rig = api.make_rig({"rig": {"kind": "friction"}, "contact": {"friction_coefficient": 0.1, **contact}})
    return api.identify(rig, [record]).finding


@pytest.mark.parametrize(
    ("law", "verdict", "effects"),
    [
        ("none", "none", set()),
        ("rational Stribeck", "named", {"stribeck"}),
        ("minimum", "named", {"stribeck", "viscous_drag"}),
        ("adhesion", "named", {"adhesive_contact"}),
        ("soft contact", "named", {"hertzian_contact"}),
    ],
)
def test_what_the_law_holds_is_named(law: str, verdict: str, effects: set[str]) -> None:
    finding = found(table(LAWS[law]()))
    assert finding.verdict == verdict
    assert {effect.id for effect in finding.effects} == effects
    assert finding.error["train"]["augmented"] < 2 * finding.noise_floor


def test_a_law_out_of_the_catalogue_is_unknown() -> None:
    assert found(table(LAWS["ripples"]())).verdict == "unknown"


def test_one_number_fitted_to_many_speeds_is_no_interpolation() -> None:
    finding = found(table(MU))
    assert finding.verdict == "none"
    assert interpolation(finding) == ""


def test_a_coefficient_says_the_same_as_its_force() -> None:
    force = table(LAWS["rational Stribeck"]())
    columns = {name: values for name, values in force.columns.items() if name != "force_N"}
    coefficient = Record("table", "friction", {**columns, "friction_coefficient": force["force_N"] / N})
    told = [{e.id: e.parameters["excess"].value for e in found(r).effects} for r in (force, coefficient)]
    assert told[0]["stribeck"] == pytest.approx(told[1]["stribeck"], rel=0.02)


def test_what_a_table_does_not_hold_is_no_candidate_and_is_said() -> None:
    rows = N == 0.2
    record = table(LAWS["rational Stribeck"]()).rows(rows)
    finding = found(record)
    assert [effect.id for effect in finding.effects] == ["stribeck"]
    said = " ".join(finding.statements)
    assert "cannot show an adhesive contact: the loads lie between 200 mN and 200 mN" in said
    assert "cannot show a directional asymmetry: the contact slides in one direction only" in said
    assert finding.next_experiment is not None
    assert "loads" in finding.next_experiment


def test_the_ends_of_a_curve_are_never_left_out() -> None:
    record = table(MU).rows(N == 0.2)
    kind = kind_for(parse_rig({"rig": {"kind": "friction"}}), [record])
    for training, validation in kind.splits([record]):
        speeds = np.concatenate([r["velocity_m_s"] for r in training])
        assert (speeds.min(), speeds.max()) == (V.min(), V.max())
        assert not np.isin(np.concatenate([r["velocity_m_s"] for r in validation]), speeds).any()


def test_backwards_is_the_mirror_image() -> None:
    forward = table(MU)
    kind = kind_for(parse_rig({"rig": {"kind": "friction"}}), [forward])
    theta = Theta.of({("stribeck", "excess"): 0.4, ("viscous_drag", "coefficient_N"): 0.01})
    back = forward.with_column("velocity_m_s", -V)
    assert kind.predict(back, theta) == pytest.approx(-kind.predict(forward, theta))


def test_a_known_noise_and_no_load_leave_a_force_as_base() -> None:
    record = Record("table", "friction", {"velocity_m_s": V, "force_N": np.full(V.size, 0.02)})
    rig = parse_rig({"rig": {"kind": "friction"}, "noise": {"force_std_N": 1e-3}})
    kind = kind_for(rig, [record])
    assert kind.nominal() == {"friction_N": pytest.approx(0.02)}
    assert kind.noise_floor([record]) == pytest.approx(1e-3 / np.sqrt(9))
