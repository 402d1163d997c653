"""What stands in a class: every candidate that explains the records as well in the place of a named effect."""

import tomllib

import numpy as np
import pytest

from models.effects.effect import Effect
from models.effects.force import InclineGravity, PeristalticWave, Respiration, SpringOverPosition
from models.effects.friction import LumenTaper
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.search.candidates import Trial
from models.identification.search.fitted_model import FittedModel
from models.identification.search.rivals import rivals_of
from models.identification.search.screening import screen
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.rig_texts import GUT

RIG = parse_rig({"rig": {"kind": "axis"}, "noise": {"force_std_N": 0.1}})
SPRING, WAVE = "spring_over_position", PeristalticWave.id


def record(seed: int, to_and_fro: bool, stiffness: float = 25.0) -> Record:
    """A stage on a spring, pushed one way or to and fro."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 10, 1e-2)
    if to_and_fro:
        x = 0.05 * np.sin(2 * np.pi * 0.2 * t + seed) + 0.01 * np.sin(2 * np.pi * t)
    else:
        x = 0.02 * t - 0.1 + 2e-3 * np.sin(2 * np.pi * 0.7 * t + seed)
    v = np.gradient(x, t)
    force = 3 * np.gradient(v, t) + 20 * v + 8 * np.sign(v) + stiffness * x + 0.1 * rng.standard_normal(len(t))
    return Record(f"r{seed}", "axis", {"t_s": t, "position_m": x, "force_N": force})


@pytest.mark.parametrize("to_and_fro", [False, True])
def test_a_rival_that_no_round_tried_stands_in_the_class_where_the_records_cannot_tell(to_and_fro: bool) -> None:
    records = [record(seed, to_and_fro) for seed in (1, 2)]
    kind = kind_for(RIG, records)
    assert isinstance(kind, AxisKind)
    splits = kind.splits(records)
    nominal = kind.nominal()
    base = FittedModel(kind, splits).far([nominal] for _ in splits)
    screened = screen(kind, base.part, [], base.thetas[0])
    begun = next(row for row in screened if row.effect == SPRING).starts[0]
    model = base.far(([theta.with_(SPRING, begun)] for theta in base.thetas), [SPRING])
    gain = float(np.log(base.cost / model.cost))
    assert gain > 2
    rivals = {rival.effect: rival for rival in rivals_of(model, SPRING, gain, screened, [], model.cost)}
    alike = {name for name, rival in rivals.items() if rival.alike}
    assert alike == (set() if to_and_fro else {LumenTaper.id, "warming"})
    assert SPRING not in rivals


def test_a_model_that_leaves_more_than_chance_does_not_tell_apart_what_comes_as_close() -> None:
    """The form of the named effect leaves so much of itself that the lead over a rival may be an error of the form."""
    records = [record(seed, True, 2.0) for seed in (1, 2)]
    kind = kind_for(RIG, records)
    splits = kind.splits(records)
    start = kind.nominal().with_(SPRING, kind.declared(SPRING).start())
    model = FittedModel(kind, splits).far(([start] for _ in splits), [SPRING])
    apart = [
        rival for rival in rivals_of(model, SPRING, 4.0, [], [], model.cost) if not rival.alike and rival.fitted.thetas
    ]
    nearest = min(apart, key=lambda rival: rival.fitted.cost)
    chance = model.cost - 1.01 * (nearest.fitted.cost - model.cost)
    again = {rival.effect: rival.alike for rival in rivals_of(model, SPRING, 4.0, [], [], chance)}
    assert again[nearest.effect]


def test_what_the_search_tried_counts_as_it_was_fitted() -> None:
    records = [record(seed, False) for seed in (1, 2)]
    kind = kind_for(RIG, records)
    splits = kind.splits(records)
    nominal = kind.nominal()

    def fitted(effect: type[Effect], **values: float) -> list[Theta]:
        start = nominal.with_(effect.id, {**effect.start(), **values})
        return [Fitter.of(kind, part, [effect.id]).far([start]).theta for part, _ in splits]

    model = FittedModel(kind, splits).fitted(fitted(SpringOverPosition, stiffness_N_per_m=10.0), [SPRING])
    taper = fitted(LumenTaper, slope_per_m=2.0, reach_m=0.2)
    tried = model.fitted(taper, [LumenTaper.id])
    trial = Trial(LumenTaper.id, tried, tried.blocks + 1)
    rivals = {rival.effect: rival for rival in rivals_of(model, SPRING, 4.0, [], [trial], model.cost)}
    assert rivals[LumenTaper.id].alike
    assert rivals[LumenTaper.id].fitted.cost <= tried.cost * 1.001


def test_an_effect_that_can_imitate_another_stands_in_its_class() -> None:
    """Asymmetric dry friction is dry friction and a constant force; a sensor's zero is neither."""
    rig = parse_rig(
        {
            "rig": {"kind": "coil", "force_constant_N_per_A": 0.5},
            "capsule": {"radius_m": 6.5e-3, "cylinder_length_m": 0.02, "mass_kg": 4e-3},
            "surface": {"kind": "plate", "friction_coefficient": 0.3},
            "noise": {"position_std_m": 5e-5},
        }
    )
    t = np.arange(0, 8, 5e-3)
    records = [
        Record(
            f"r{k}",
            "coil",
            {
                "t_s": t,
                "coil_current_A": 0.04 * np.sin((1.5 + 0.4 * k) * t) * np.sin(7.1 * t),
                "position_m": np.zeros_like(t),
            },
        )
        for k in range(3)
    ]
    kind = kind_for(rig, records)
    assert isinstance(kind, SeriesKind)
    theta = kind.nominal().with_(InclineGravity.id, InclineGravity.start()) | {("incline_gravity", "force_N"): 2e-3}
    rng = np.random.default_rng(3)
    unexplained = 4e-4 * np.sin(0.9 * t) + 5e-5 * rng.standard_normal(len(t))
    records = [r.with_column("position_m", kind.predict(r, theta) + unexplained) for r in records]
    kind = kind_for(rig, records)
    splits = kind.splits(records)
    model = FittedModel(kind, splits).fitted([theta for _ in splits], [InclineGravity.id])
    rivals = {rival.effect: rival for rival in rivals_of(model, InclineGravity.id, 3.0, [], [], model.cost)}
    assert rivals["directional_asymmetry"].alike
    assert not rivals["sensor_bias"].alike


def breathing(span_m: float) -> tuple[FittedModel, list[Theta]]:
    """A pull to and fro through `span_m` under a force in time, the model that made it, and a wave that is as long."""
    rig = parse_rig({"rig": {"kind": "pull"}, "noise": {"force_std_N": 1e-3}, **tomllib.loads(GUT)})
    t = np.arange(0, 16, 1e-2)
    records = [
        Record(
            f"r{k}",
            "pull",
            {
                "t_s": t,
                "position_m": span_m * (0.5 - 0.5 * np.cos((0.5 + 0.1 * k) * t)),
                "force_N": np.sin(t),
            },
        )
        for k in range(2)
    ]
    kind = kind_for(rig, records)
    assert isinstance(kind, SeriesKind)
    theta = kind.nominal().with_(Respiration.id, Respiration.start()) | {("respiration", "force_N"): 0.015}
    rng = np.random.default_rng(3)
    records = [r.with_column("force_N", kind.predict(r, theta) + 1e-3 * rng.standard_normal(len(t))) for r in records]
    splits = kind.splits(records)
    wave = Theta(theta.base, {WAVE: {**theta.effects["respiration"], "wavenumber_per_m": 0.1}})
    return FittedModel(kind, splits).fitted([theta for _ in splits], [Respiration.id]), [wave for _ in splits]


@pytest.mark.parametrize(("span_m", "alike"), [(0.03, False), (0.3e-3, True)])
def test_a_wave_that_stands_everywhere_at_once_is_no_rival_of_a_force_in_time(span_m: float, alike: bool) -> None:
    """A wave at least: over 30 mm it would come late by a tenth of a turn, over 0.3 mm by nothing that shows."""
    model, waves = breathing(span_m)
    assert model.fitted(waves, [WAVE]).cost == pytest.approx(model.cost, rel=0.05)
    trial = Trial(WAVE, model.fitted(waves, [WAVE]), model.blocks + 1)
    rivals = {rival.effect: rival for rival in rivals_of(model, Respiration.id, 3.0, [], [trial], model.cost)}
    assert rivals[WAVE].alike == alike
    assert all(abs(theta[WAVE, "wavenumber_per_m"]) >= 3.5 for theta in rivals[WAVE].fitted.thetas)
