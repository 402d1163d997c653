"""What benches add to an axis is found in forms that are not the catalogue's."""

import numpy as np
import pytest

from models.identification import close
from models.identification.finding import Finding
from models.records.record import record_of
from models.rigs.reader import parse_rig
from tests.plant.axis_series import (
    Bench,
    Floats,
    cogging,
    columns,
    coulomb,
    motion,
    piston,
    slipping,
    thinning,
    two_masses,
)

RIG = parse_rig({"rig": {"kind": "axis"}, "noise": {"force_std_N": 0.2}})


def closed(bench: Bench) -> Finding:
    first, second, held = (record_of(f"run_{seed}", columns(bench, seed), RIG) for seed in (1, 2, 3))
    return close(RIG, [first, second], [held], lambda stage, share: None)[0]


def test_an_axis_with_idle_inputs_lacks_nothing() -> None:
    finding = closed(coulomb)
    assert (finding.verdict, finding.effects) == ("none", ())


@pytest.mark.parametrize(
    ("bench", "effect"),
    [
        (piston, "load_force"),
        (slipping, "presliding"),
        (cogging, "torque_ripple"),
        (thinning, "warming"),
        (two_masses, "elastic_drive"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_bench_is_found(bench: Bench, effect: str) -> None:
    finding = closed(bench)
    assert [found.id for found in finding.effects][:1] == [effect]
    held = finding.error["holdout"]
    assert held["augmented"] < 0.5 * held["calibrated"]


def lubricated(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Friction that falls as a hyperbola of the logged temperature."""
    warm = 20 + 15 * (1 - np.exp(-m["t"] / 6))
    return 3 / (1 + (warm - 20) / 12) * np.sign(m["v"]), np.zeros(len(warm)), {"temperature_degC": warm}


def test_friction_falls_with_a_logged_temperature() -> None:
    finding = closed(lubricated)
    assert [found.id for found in finding.effects][:1] == ["warming"]
    assert finding.effects[0].parameters["fall_per_K"].value == pytest.approx(0.06, abs=0.03)


def pressed(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Dry friction that grows with a logged load, a little less than in proportion; viscous friction does not."""
    load = 30 + 25 * np.sin(0.7 * m["t"] + rng.uniform(0, 6))
    return 3 * (1 + 0.03 * load**0.95) * np.sign(m["v"]), np.zeros(len(load)), {"load_1": load}


def test_a_load_on_dry_friction_does_not_make_a_drag_of_the_viscous_one() -> None:
    finding = closed(pressed)
    assert [found.id for found in finding.effects] == ["load_dependent_friction"]
    assert finding.calibration["viscous_friction_N_s_per_m"].value == pytest.approx(20, abs=1)
    assert finding.calibration["coulomb_friction_N"].value == pytest.approx(3, abs=0.3)


@pytest.mark.parametrize("column", ["pressure_bar", "load_1"])
def test_an_input_that_cannot_be_used_is_left_out_with_a_note(column: str) -> None:
    m = motion(1)
    columns = {"t_s": m["t"], "position_m": m["x"], "force_N": m["v"], column: np.where(m["t"] < 1, np.nan, 1.0)}
    read = record_of("run", columns, RIG)
    assert any(f"column {column} is left out" in note for note in read.notes)
    assert "load_1" not in read.columns
