"""Tables as other labs write them: what no rig gives stops before the fit, what one gives is left alone."""

import tomllib
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from models.checks.examine import examine
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from tests.rig_texts import PLATE

Array = NDArray[np.float64]
Columns = dict[str, Array]
RIGS = {
    "friction": parse_rig({"rig": {"kind": "friction"}}),
    "dma": parse_rig({"rig": {"kind": "dma"}}),
    "periods": parse_rig({"rig": {"kind": "periods", "velocity_m_s": 5e-4}}),
    "vibro_table": parse_rig({"rig": {"kind": "vibro_table"}, **tomllib.loads(PLATE)}),
}


def table(kind: str) -> Columns:
    """A table of `kind` as it should be."""
    rng, n = np.random.default_rng(2), 12
    speed = np.geomspace(1e-4, 2e-2, n)
    omega = np.geomspace(1.0, 100.0, n)
    return {
        "friction": {
            "velocity_m_s": np.r_[speed, -speed],
            "force_N": np.r_[0.05 + 0.5 * speed, -0.05 - 0.5 * speed],
        },
        "dma": {
            "frequency_Hz": omega,
            "storage_modulus_Pa": 5e5 * omega**0.2,
            "loss_modulus_Pa": 2e5 * omega**0.2,
        },
        "periods": {
            "period_s": 0.1 + 0.01 * rng.random(n),
            "valley_N": 0.023 + 1e-3 * rng.random(n),
            "peak_N": 0.034 + 1e-3 * rng.random(n),
        },
        "vibro_table": {
            "period_s": np.linspace(0.03, 0.2, n),
            "duty": np.linspace(0.2, 0.8, n),
            "cycles": np.full(n, 100.0),
            "mean_velocity_m_s": 2e-2 * np.sin(np.arange(n)),
        },
    }[kind]


def told(rig: Rig, columns: Columns) -> set[str]:
    """Ids of what stops the records."""
    found = examine(rig, [Record("table", rig.kind, columns)])
    assert all(finding.severity == "stops" for finding in found)
    return {finding.id for finding in found}


@pytest.mark.parametrize("kind", RIGS)
def test_a_right_table_is_left_alone(kind: str) -> None:
    assert told(RIGS[kind], table(kind)) == set()
    once = {name: values[:1] for name, values in table(kind).items()}
    assert told(RIGS[kind], once) == set()


@pytest.mark.parametrize(
    ("kind", "column", "change", "found"),
    [
        ("friction", "velocity_m_s", lambda v: 1e4 * v, "units"),
        ("friction", "force_N", np.negative, "force_sign"),
        ("friction", "force_N", np.abs, "force_unsigned"),
        ("friction", "force_N", lambda v: 0 * v + 0.05, "no_response"),
        ("dma", "storage_modulus_Pa", lambda v: 1e-3 * v, "units"),
        ("dma", "loss_modulus_Pa", np.negative, "units"),
        ("periods", "peak_N", lambda v: 1e3 * v, "units"),
        ("periods", "period_s", lambda v: 1e3 * v, "units"),
        ("vibro_table", "mean_velocity_m_s", lambda v: 1e3 * v, "units"),
        ("vibro_table", "duty", lambda v: 100 * v, "units"),
        ("vibro_table", "period_s", lambda v: 1e3 * v, "units"),
        ("vibro_table", "period_s", np.reciprocal, "units"),
    ],
)
def test_what_no_rig_gives_stops(kind: str, column: str, change: Callable[[Array], Array], found: str) -> None:
    columns = table(kind)
    assert found in told(RIGS[kind], columns | {column: change(columns[column])})


def test_a_coefficient_has_no_sign_to_miss() -> None:
    rig = RIGS["friction"]
    speed = table("friction")["velocity_m_s"]
    assert told(rig, {"velocity_m_s": speed, "friction_coefficient": 0.1 + np.abs(speed)}) == set()
