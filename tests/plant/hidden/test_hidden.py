"""Hidden effects: each one changes what it should, none changes anything while its amplitude is zero."""

import numpy as np
import pytest

from models.laws.geometry import Capsule
from plant import layout as at
from plant.compiling import source_digest
from plant.drives import TrueCoil, TrueDrive, TrueMagnet, TruePull, TrueVibro
from plant.experiments.profile import Wander, WholeRuns, pulse_width
from plant.hidden.registry import HIDDEN, Hidden, hidden
from plant.hidden.table import effect_table
from plant.rig import STEP_S, Plant, Truth
from plant.sensing import Sensor
from plant.steps import advance
from plant.tables import Floats
from tests.plant.series import draw

CASES = [(kind, effect) for effect in HIDDEN for kind in ("pull", "magnetic", "coil", "vibro") if kind in effect.drives]
DRIVES: dict[str, TrueDrive] = {
    "pull": TruePull(),
    "magnetic": TrueMagnet(),
    "coil": TrueCoil(),
    "vibro": TrueVibro(0.0231, 360.0, force_N=0.6),
}


def reading(kind: str, chosen: dict[str, dict[str, float]]) -> Floats:
    rng = np.random.default_rng(7)
    rig = Truth(DRIVES[kind], capsule=Capsule(mass_kg=0.0213 if kind == "vibro" else 4e-3), hidden=chosen)
    if kind == "pull":
        drive = WholeRuns().values(5.0, STEP_S, rng)
    elif kind == "magnetic":
        drive = Wander().values(5.0, STEP_S, rng)
    elif kind == "coil":
        drive = 4.0 * np.sin(STEP_S * np.arange(200_001) * 2.0)
    else:
        drive = 0.6 * pulse_width(0.08, 0.3, 4.0, STEP_S)
    plant = Plant(rig)
    rows = plant.advance(drive, 50)
    _, y = Sensor().measure(rows[:, at.O_T], rows[:, at.O_FORCE if kind == "pull" else at.O_X], rng, plant.effects)
    return y


@pytest.fixture(scope="module")
def plain() -> dict[str, Floats]:
    return {kind: reading(kind, {}) for kind in DRIVES}


@pytest.mark.parametrize(("kind", "effect"), CASES, ids=lambda case: case if isinstance(case, str) else case.id)
def test_every_effect_shows_and_stays_finite(kind: str, effect: Hidden, plain: dict[str, Floats]) -> None:
    y = reading(kind, {effect.id: {"path_m": 5e-3} if effect.id == "travel_step" else {}})
    assert np.all(np.isfinite(y))
    assert np.max(np.abs(y - plain[kind])) > 1e-3 * np.ptp(plain[kind])


def test_a_zero_amplitude_is_no_effect(plain: dict[str, Floats]) -> None:
    for kind in ("pull", "magnetic"):
        silent = {e.id: {e.numbers[0].name: 0.0} for e in HIDDEN if kind in e.drives}
        assert np.array_equal(reading(kind, silent), plain[kind])


def test_an_unseen_tiny_effect_changes_next_to_nothing(plain: dict[str, Floats]) -> None:
    """The steps with and without hidden effects are the same steps."""
    y = reading("magnetic", {"incline_gravity": {"angle_rad": 1e-12}})
    assert y == pytest.approx(plain["magnetic"], abs=1e-6)


def test_incline_is_the_weight_s_share() -> None:
    """Force of a slow steady pull uphill minus downhill is `2 m g sin(angle)`."""
    drive = 1e-3 * STEP_S * np.arange(100_001)
    rigs = [Truth(TruePull(), hidden={"incline_gravity": {"angle_rad": angle}}) for angle in (0.3, -0.3)]
    force = [np.mean(Plant(rig).advance(drive)[:, at.O_FORCE]) for rig in rigs]
    assert force[0] - force[1] == pytest.approx(2 * 4e-3 * 9.81 * np.sin(0.3), rel=1e-9)


def test_unknown_names_hear_the_nearest() -> None:
    with pytest.raises(ValueError, match="did you mean 'stribeck'"):
        hidden("stribek")
    with pytest.raises(ValueError, match="did you mean 'excess'"):
        effect_table({"stribeck": {"exces": 1.0}})


@pytest.mark.parametrize(
    ("name", "number", "value"), [("stribeck", "speed_m_s", 0.0), ("sensor_delay", "time_s", -0.1)]
)
def test_impossible_numbers_are_refused(name: str, number: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"effects.{name}.{number} must be"):
        effect_table({name: {number: value}})


def test_the_compiled_steps_are_renewed_with_any_file_of_the_plant() -> None:
    assert advance._cache._cache_file._source_stamp == source_digest()  # type: ignore[attr-defined]


def test_draws_lie_in_their_ranges(rng: np.random.Generator) -> None:
    for effect in HIDDEN:
        for shape in effect.numbers:
            value = abs(draw(effect.id, rng)[shape.name])
            assert shape.lower <= value <= shape.upper
