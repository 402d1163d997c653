"""Units as people write them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.files.units import UNITS, factor, fitting, nearest_unit, split_unit, unit, unit_of
from models.rigs.columns import TIME
from models.rigs.kinds import KINDS


@pytest.mark.parametrize(
    ("text", "target", "expected"),
    [
        ("mm", "m", 1e-3),
        ("um", "m", 1e-6),
        ("\u00b5m", "m", 1e-6),
        ("\u03bcm", "m", 1e-6),
        ("cm", "m", 1e-2),
        ("inch", "m", 0.0254),
        ("ms", "s", 1e-3),
        ("us", "s", 1e-6),
        ("min", "s", 60),
        ("seconds", "s", 1),
        ("Milliseconds", "s", 1e-3),
        ("mN", "N", 1e-3),
        ("kN", "N", 1e3),
        ("gf", "N", 9.80665e-3),
        ("g", "N", 9.80665e-3),
        ("kgf", "N", 9.80665),
        ("mA", "A", 1e-3),
        ("mV", "V", 1e-3),
        ("kPa", "Pa", 1e3),
        ("MPa", "Pa", 1e6),
        ("kHz", "Hz", 1e3),
        ("1/s", "Hz", 1),
        ("rpm", "Hz", 1 / 60),
        ("deg", "rad", math.pi / 180),
        ("rev", "rad", 2 * math.pi),
        ("rad/s", "Hz", 1 / (2 * math.pi)),
        ("deg/s", "rad/s", math.pi / 180),
        ("mm/s", "m_s", 1e-3),
        ("mm_per_s", "m_s", 1e-3),
        ("mm s^-1", "m_s", 1e-3),
        ("mm/min", "m_s", 1e-3 / 60),
        ("%", "", 0.01),
        ("[mm]", "m", 1e-3),
    ],
)
def test_a_unit_is_told_in_ours(text: str, target: str, expected: float) -> None:
    assert factor(text, target) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "target"), [("mm", "N"), ("furlong", "m"), ("", "m"), ("mm/", "m"), ("/", ""), ("m", "")]
)
def test_what_is_no_unit_of_ours_has_no_factor(text: str, target: str) -> None:
    assert factor(text, target) is None


def test_the_nearest_unit_is_named() -> None:
    assert nearest_unit("milimeter", "m") == "did you mean 'millimeter'?"
    assert nearest_unit("mmm", "m") == "did you mean 'mm'?"


NUMBERED = [f"load_{number}" for number in range(2, 10)]
MEASURED_IN = {
    "m": ["position", "carriage_position", "load_position"], "rad": ["angle", "load_angle"], "s": ["t", "period"],
    "m/s": ["velocity", "mean_velocity"], "rad/s": ["velocity"], "m/s2": ["acceleration"],
    "N": ["force", "drive_force", "load", "peak", "valley"], "N m": ["torque", "load"], "A": ["coil_current"],
    "V": ["coil_voltage"], "Hz": ["frequency"], "Pa": ["storage_modulus", "loss_modulus", "pressure"],
    "1": ["cycles", "duty", "drive_on", "friction_coefficient", "temperature_degC", "load", *NUMBERED],
}  # fmt: skip


def test_every_column_of_ours_has_the_unit_that_its_name_ends_in() -> None:
    columns = sorted({name for kind in KINDS.values() for name in kind.known} | {TIME})
    for column in columns:
        stem, written = split_unit(column)
        (measured_in,) = [one for one in MEASURED_IN if stem in MEASURED_IN[one] and factor(written or "1", one) == 1.0]
        assert factor(unit_of(column) or "1", measured_in) == 1.0
    assert {split_unit(column)[0] for column in columns} == {stem for stems in MEASURED_IN.values() for stem in stems}


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("Position [mm]", ("Position", "mm")),
        ("force (mN)", ("force", "mN")),
        ("pos_mm", ("pos", "mm")),
        ("F / mN", ("F", "mN")),
        ("Time(ms)", ("Time", "ms")),
        ("speed, mm/s", ("speed", "mm/s")),
        ("travel in inch", ("travel", "inch")),
        ("Temp [K]", ("Temp", "K")),
        ("Time", ("Time", "")),
        ("drive_on", ("drive_on", "")),
        ("[mm]", ("[mm]", "")),
        ("", ("", "")),
    ],
)
def test_a_header_is_split_from_its_unit(name: str, parts: tuple[str, str]) -> None:
    assert split_unit(name) == parts


@given(st.text(max_size=20))
def test_any_text_is_a_unit_or_none(text: str) -> None:
    found = unit(text)
    assert found is None or (found.factor > 0 and math.isfinite(found.factor))
    split_unit(text)


@given(st.sampled_from(sorted(UNITS)), st.sampled_from(sorted(UNITS)))
def test_there_and_back_is_one(one: str, other: str) -> None:
    there, back = factor(one, other), factor(other, one)
    assert (there is None) == (back is None)
    if there is not None and back is not None:
        assert there * back == pytest.approx(1.0)
        assert one in fitting(other)
