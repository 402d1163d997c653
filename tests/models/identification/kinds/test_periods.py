"""Stick-slip periods: paper A's times from its own law, the missing stiffness, and what one speed cannot tell."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from models.effects.effect import Signals
from models.effects.wall import SmallStrainStiffening, WallViscosity
from models.formula import line_text
from models.identification.kinds.periods import COLUMNS, PeriodsKind, relative_errors
from models.identification.kinds.reports import periods as report
from models.identification.settings import SET
from models.parameter import SETS
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta

KIND = PeriodsKind.from_rig(Rig("periods"))
STIFFER = ("small_strain_stiffening", "excess")


def measured() -> Record:
    with (SETS / "measured" / "analytical_table2_periods.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return Record("paper A Table 2", "periods", {c: np.array([float(r[c]) for r in rows]) for c in rows[0]})


def fitted(kind: PeriodsKind, records: list[Record], theta: Theta) -> Theta:
    names = list(theta)

    def misfit(q: np.ndarray) -> np.ndarray:
        return np.concatenate([kind.residual(r, Theta.of(zip(names, q, strict=True))) for r in records])

    scale = [max(abs(v), 0.05) for v in theta.values()]
    low = [1e-3 if isinstance(n, str) else -0.8 for n in names]
    q = least_squares(misfit, list(theta.values()), bounds=(low, [50.0] * len(names)), x_scale=scale).x
    return Theta.of(zip(names, map(float, q), strict=True))


def off(kind: PeriodsKind, theta: Theta) -> np.ndarray:
    return relative_errors(kind.measured(measured()), kind.predict(measured(), theta))


@pytest.fixture(scope="module")
def calibrated() -> Theta:
    return fitted(KIND, [measured()], KIND.nominal())


@pytest.mark.parametrize(("length_m", "period_s"), [(26.5e-3, 0.3184), (20e-3, 0.2403)])
def test_paper_a_s_own_law_gives_its_correct_period(length_m: float, period_s: float) -> None:
    tooth = replace(KIND, length_m=length_m, return_speed_m_s=SET.return_m_s).tooth(0.01656, 0.5e-3, Theta())
    assert tooth.period_s == pytest.approx(period_s, rel=5e-4)
    assert tooth.period_s / 0.0912 - 1 == pytest.approx(2.49 if length_m > 0.02 else 1.635, abs=0.02)


def test_base_model_s_recovery_takes_its_own_time() -> None:
    tooth = KIND.tooth(0.01656, 0.5e-3, Theta())
    assert tooth.fall_s == 0.05
    assert tooth.rise_s == pytest.approx(0.2189, abs=1e-4)


def test_calibrated_forces_fit_and_the_period_does_not(calibrated: Theta) -> None:
    period, valley, peak = off(KIND, calibrated)
    assert abs(valley) < 0.005
    assert abs(peak) < 0.005
    assert 1.2 < period < 1.5  # of which the recovery time alone makes 0.05 s


def test_stiffening_at_small_drag_brings_all_three_within_ten_percent(calibrated: Theta) -> None:
    theta = fitted(KIND, [measured()], Theta.of({**calibrated, STIFFER: 0.5}))
    assert np.max(np.abs(off(KIND, theta))) < 0.01
    assert 2.0 < theta[STIFFER] < 5.0
    left_base, left_more = [], []
    for training, validation in KIND.splits([measured()]):
        for start, left in ((calibrated, left_base), (Theta.of({**calibrated, STIFFER: 0.5}), left_more)):
            fit = fitted(KIND, training, start)
            left.append(KIND.error(validation, [KIND.predict(r, fit) for r in validation]))
    assert np.mean(left_more) < 20 < 60 < np.mean(left_base)
    assert KIND.noise_floor([measured()]) == pytest.approx(5.9, abs=0.1)


def test_one_speed_cannot_tell_stiffening_length_and_viscosity_apart(calibrated: Theta) -> None:
    viscous = replace(KIND, effects=(WallViscosity,))
    theta = fitted(viscous, [measured()], Theta.of({**calibrated, ("wall_viscosity", "viscosity_N_s_per_m"): 2.0}))
    assert np.max(np.abs(off(viscous, theta))) < 0.01
    short = replace(KIND, length_m=6.6e-3)
    assert np.max(np.abs(off(short, fitted(short, [measured()], KIND.nominal())))) < 0.02
    assert "wall_viscosity" in KIND.equivalents["small_strain_stiffening"]


def test_several_speeds_do_tell_them_apart(calibrated: Theta) -> None:
    viscous = replace(KIND, effects=(WallViscosity,))
    stiff = fitted(KIND, [measured()], Theta.of({**calibrated, STIFFER: 0.5}))
    thick = fitted(viscous, [measured()], Theta.of({**calibrated, ("wall_viscosity", "viscosity_N_s_per_m"): 2.0}))
    stiff_rise, thick_rise = (c.peak - c.valley for c in (KIND.cycle(5e-3, stiff), viscous.cycle(5e-3, thick)))
    assert thick_rise > 2 * stiff_rise


def test_report_says_what_is_equivalent_and_what_to_do(calibrated: Theta) -> None:
    theta = fitted(KIND, [measured()], Theta.of({**calibrated, STIFFER: 0.5}))
    stages = {"nominal": KIND.nominal(), "calibrated": calibrated, "augmented": theta}
    words = " ".join(report.statements(KIND, stages, [measured()]))
    for piece in (
        "At one speed these explanations are confounded",
        "stretched length of 6.6",
        "times stiffer",
        "resists the rate of stretch",
        "0.3184 s",
        "0.2403 s",
    ):
        assert piece in words
    experiment = str(report.next_experiment(KIND, theta, [measured()], {}))
    assert "several speeds" in experiment
    assert "step and hold" in experiment
    assert "a wall stiffer at small strain: tension scale = 1 + " in " ".join(
        map(line_text, report.equations(KIND, theta))
    )


def test_recoil_follows_the_rig_file_at_every_speed() -> None:
    """The wall draws back within `recovery_time_s`, whatever the speed of the pull."""
    for time in (0.02, 0.05, 0.1):
        rig = parse_rig({"rig": {"kind": "periods"}, "tissue": {"recovery_time_s": time}})
        kind = PeriodsKind.from_rig(rig)
        for speed in (0.5e-3, 10e-3):
            assert kind.cycle(speed, kind.nominal()).tooth.fall_s == time


def test_base_model_s_period_falls_with_speed() -> None:
    """The check values of physics.md."""
    periods = [KIND.cycle(v, KIND.nominal()).tooth.period_s for v in (0.5e-3, 10e-3)]
    assert periods == pytest.approx([0.530, 0.077], abs=5e-4)


def test_several_speeds_are_judged_each_by_its_own_means() -> None:
    record = measured().with_column("velocity_m_s", np.repeat([0.5e-3, 10e-3], 4))
    kind = PeriodsKind.from_rig(parse_rig({"rig": {"kind": "periods"}}), [record])
    assert {effect.id for effect in kind.effects} == {"small_strain_stiffening", "wall_viscosity"}
    assert not kind.equivalents
    made = np.concatenate([np.full((4, 3), [0.1, 0.02, 0.03]), np.full((4, 3), [1.0, 0.1, 0.2])])
    for i, column in enumerate(COLUMNS):
        record = record.with_column(column, made[:, i])
    off = made.copy()
    off[:4] *= 1.1
    assert kind.error([record], [off]) == pytest.approx(100 * np.sqrt(0.1**2 / 2))
    for training, validation in kind.splits([record]):
        for part in (training, validation):
            assert len(kind.speeds_of(part)) == 2
    words = " ".join(report.statements(kind, {"nominal": kind.nominal(), "calibrated": kind.nominal()}, [record]))
    assert "From 500 µm/s to 10 mm/s the measured period goes from 100 ms to 1 s (times 10)" in words
    assert "twice over the same stretch" in str(report.next_experiment(kind, kind.nominal(), [record], {}))


def test_imitations_scatter_about_the_model_not_about_the_record() -> None:
    """A model far off the record still gives periods that are all positive."""
    theta = Theta({"hoop_factor": 0.1, "friction_coefficient": 0.5})
    made = KIND.measured(KIND.imitate(measured(), theta, np.random.default_rng(0)))
    assert made.mean(0) == pytest.approx(KIND.predict(measured(), theta).mean(0), rel=0.3)


def test_speed_column_overrules_the_rig_and_weighs_all_alike() -> None:
    record = measured().with_column("velocity_m_s", np.repeat([0.5e-3, 1e-3], 4))
    periods = KIND.predict(record, KIND.nominal())[:, 0]
    assert periods[0] > periods[-1]
    assert len(KIND.residual(record, KIND.nominal())) == 24


def test_imitation_scatters_as_the_measured_periods() -> None:
    theta = fitted(KIND, [measured()], KIND.nominal() | {STIFFER: 0.5})
    rng = np.random.default_rng(3)
    made = np.concatenate([KIND.measured(KIND.imitate(measured(), theta, rng)) for _ in range(200)])
    scatter = made.std(0) / made.mean(0)
    assert scatter == pytest.approx(KIND.scatter, rel=0.1)
    assert set(COLUMNS) <= set(measured().columns)


def test_stiffening_fades_and_tension_stays_monotone() -> None:
    effect, most = SmallStrainStiffening(), 7.0
    u = np.linspace(0, 2e-3, 400)
    factor = effect.stiffening(Signals(drag=u), {"excess": most, "scale_m": 2e-4, "tail": 1e-3}, {})
    assert factor[0] == pytest.approx(1 + most)
    assert factor[-1] == pytest.approx(1.0, abs=1e-3)
    assert np.all(np.diff(u * factor) > 0)


def test_rig_file_gives_capsule_tissue_and_speed() -> None:
    kind = PeriodsKind.from_rig(
        parse_rig({"rig": {"kind": "periods", "velocity_m_s": 1e-3}, "capsule": {}, "tissue": {}})
    )
    assert kind.velocity_m_s == 1e-3
    assert kind.length_m == pytest.approx(26.5e-3)
    assert kind.nominal() == {"hoop_factor": 1.0, "friction_coefficient": 0.082}
