"""The capsubot's mean speed: reference speeds, symmetry, effects, the criterion, measured runs."""

from dataclasses import replace

import numpy as np
import pytest

from models.assembly.model import assemble
from models.compiled.cycles import STEP_S, Cycles
from models.drives.vibro import Vibro
from models.effects.drive import CoilLag
from models.effects.effect import Signals
from models.effects.force import InclineGravity
from models.effects.inner_mass import SpringDamping
from models.formula import line_text
from models.identification.kinds.reports import vibro_table as report
from models.identification.kinds.reports.vibro_table import cross_validated, reversal
from models.identification.kinds.vibro_table import PlateAsymmetry, VibroTableKind
from models.identification.search.search import search
from models.laws.geometry import GRAVITY
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.surfaces.surface import Plate
from models.theta import Theta

RIG = {
    "rig": {"kind": "vibro_table"},
    "capsule": {"mass_kg": 0.193},
    "drive": {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 256.23, "force_N": 1.25, "reaction_on_body": True},
    "surface": {"kind": "plate", "friction_coefficient": 0.29},
}
KIND = VibroTableKind.from_rig(parse_rig(RIG))
MIRRORED = replace(KIND, base=tuple(p.at(-1.0) if p.name == "mirror" else p for p in KIND.base))
EFFECTS = KIND.effects
SMALL = VibroTableKind.from_rig(
    parse_rig(
        RIG
        | {
            "capsule": {"mass_kg": 0.0213},
            "drive": RIG["drive"] | {"inner_mass_kg": 0.0231, "spring_stiffness_N_per_m": 360.0, "force_N": 0.8},
            "surface": {"kind": "plate", "friction_coefficient": 0.7 / (0.0444 * GRAVITY)},
        }
    )
)
DAMPED = Theta({"spring_stiffness_N_per_m": 286.5, "force_N": 3.16, "friction_coefficient": 0.6647, "mirror": -1.0})
DAMPED |= {("spring_damping", "damping_N_s_per_m"): 2.349, ("coil_lag", "time_s"): 0.002788}


def record(period: object, duty: object, cycles: object, speed: object = 0.0) -> Record:
    columns = dict(zip(("period_s", "duty", "cycles", "mean_velocity_m_s"), (period, duty, cycles, speed), strict=True))
    arrays = np.broadcast_arrays(*(np.asarray(c, dtype=float) for c in columns.values()))
    return Record("made", "vibro_table", {k: np.array(a) for k, a in zip(columns, arrays, strict=True)})


def effects(**values: dict[str, float]) -> Theta:
    return Theta(effects=values)


def settled(
    period: object, duty: object, cycles: int, settle: int, theta: Theta | None = None, kind: VibroTableKind = KIND
) -> np.ndarray:
    """Mean speeds over `cycles` periods after `settle` others from rest."""
    before, whole = (n * kind.predict(record(period, duty, n), theta or Theta()) for n in (settle, settle + cycles))
    return (whole - before) / cycles


@pytest.mark.parametrize(
    ("kind", "period", "duty", "speed"),
    [(KIND, 0.060, 0.3, -8.275e-3), (KIND, 0.097, 0.14, 19.625e-3), (SMALL, 0.0441, 0.785, -75.85e-3)],
)
def test_steady_speeds_of_the_reference(kind: VibroTableKind, period: float, duty: float, speed: float) -> None:
    assert settled([period], duty, 200, 400, kind=kind) == pytest.approx(speed, rel=2e-3)


def test_linear_drive_is_antisymmetric_in_duty() -> None:
    duty = np.array([0.1, 0.25, 0.3, 0.4, 0.45])
    forward, backward = settled(0.085, duty, 100, 600), settled(0.085, 1 - duty, 100, 600)
    assert np.max(np.abs(forward)) > 2e-3
    np.testing.assert_allclose(backward, -forward, atol=2e-5)
    assert settled([0.085], 0.5, 100, 600) == pytest.approx(0, abs=2e-5)


def test_a_squared_current_breaks_the_antisymmetry_and_a_lagging_force_does_not() -> None:
    for lag, broken in (("actuator_lag", False), ("coil_lag", True)):
        lagged = effects(spring_damping={"damping_N_s_per_m": 1.0}) | effects(**{lag: {"time_s": 0.003}})
        pair = settled(0.06, np.array([0.3, 0.7]), 50, 100, lagged)
        assert bool(abs(pair.sum()) > 1e-4) is broken


def test_a_push_below_friction_moves_the_body_by_exactly_nothing() -> None:
    weak = Theta({"force_N": 0.3}) | effects(spring_damping={"damping_N_s_per_m": 0.5})
    assert np.all(KIND.predict(record(np.array([0.03, 0.06, 0.3]), 0.3, 5000), weak) == 0.0)


def test_the_step_converges_and_the_periodic_short_cut_changes_nothing() -> None:
    damped = tuple(e for e in KIND.effects if e.id in DAMPED.effects)
    cycles = Cycles(assemble(Plate(0.193), Vibro(0.074), damped))
    period, duty = np.array([0.03, 0.06, 0.08, 0.1, 0.155]), np.array([0.7, 0.35, 0.3, 0.25, 0.3])
    runs = np.column_stack([period, duty, np.full(5, 40.0)])
    exact = cycles.speeds(runs, DAMPED, 1e-5)
    errors = [np.max(np.abs(cycles.speeds(runs, DAMPED, h) - exact)) for h in (1.2e-3, 6e-4, STEP_S)]
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]
    assert errors[2] < 1e-4
    long = KIND.predict(record(period, duty, 4000), DAMPED)
    assert -long == pytest.approx(settled(period, duty, 50, 100, DAMPED | {"mirror": 1.0}), abs=2e-5)


def test_friction_carries_the_momentum_that_the_outside_force_brings() -> None:
    tilted = Theta({"force_N": 0.0}) | effects(incline_gravity={"force_N": 2.0})
    run = KIND.predict(record([0.1], 0.5, 10), tilted)
    acceleration = (2.0 - 0.29 * (0.193 + 0.074) * GRAVITY) / (0.193 + 0.074)
    assert run == pytest.approx(acceleration * 1.0 / 2, rel=0.02)


def test_every_effect_shows_and_zero_amplitude_is_no_effect() -> None:
    kind = KIND
    runs = record([0.06, 0.1, 0.155], [0.3, 0.25, 0.7], 20)
    plain = kind.predict(runs, kind.nominal())
    for effect in EFFECTS:
        values = Theta.of({(effect.id, p.name): p.value for p in effect.parameters()})
        off = kind.predict(runs, kind.nominal() | values)
        np.testing.assert_allclose(off, plain, atol=1e-12)
        amplitude = (effect.id, effect.amplitude().name)
        on = kind.predict(runs, {**kind.nominal(), **values, amplitude: effect.probe})
        assert np.max(np.abs(on - plain)) > 1e-6, effect.id


def test_the_coil_is_on_for_less_than_its_duty() -> None:
    tau, h, z = 0.003, 1e-5, {"current": 0.0}
    force = []
    for k in range(4000):
        z = CoilLag().advance(Signals(command=1.0 if k < 2000 else 0.0), {"time_s": tau}, z, h)
        force.append(float(CoilLag().command(Signals(), {}, z)))
    above = np.flatnonzero(np.array(force) > 0.5)
    assert h * len(above) == pytest.approx(0.02 - 0.88 * tau, abs=2e-5)


def test_no_values_within_bounds_and_no_condition_give_anything_but_a_speed() -> None:
    rng, kind = np.random.default_rng(5), KIND
    period, duty = (x.ravel() for x in np.meshgrid([0.02, 0.05, 0.08, 0.3], [0.0, 0.05, 0.5, 0.95, 1.0]))
    runs = record(period, duty, 20)
    for _ in range(25):
        theta = Theta.of((p.key, rng.uniform(p.lower, p.upper)) for p in kind.base if p.fit)
        for effect in (e for e in EFFECTS if rng.random() < 0.4):
            theta |= {(effect.id, p.name): rng.uniform(p.lower, p.upper) for p in effect.parameters()}
        speeds = kind.predict(runs, theta)
        assert np.all(np.abs(speeds) < 5.0)


def test_the_load_scale_is_a_common_factor_of_force_and_friction() -> None:
    kind = KIND
    runs = record([0.06, 0.1], [0.3, 0.25], 20)
    both = Theta.of({"force_N": 2.5, "friction_coefficient": 0.58, ("spring_damping", "damping_N_s_per_m"): 1.0})
    scaled = Theta.of({"load_scale": 2.0, ("spring_damping", "damping_N_s_per_m"): 1.0})
    np.testing.assert_array_equal(kind.predict(runs, scaled), kind.predict(runs, both))
    once = kind.predict(runs, Theta.of({("spring_damping", "damping_N_s_per_m"): 1.0}))
    assert kind.predict(runs, scaled) == pytest.approx(2 * once, rel=1e-3)


def test_the_criterion_is_about_one_for_a_right_model_and_reports_by_condition() -> None:
    kind = MIRRORED
    periods = np.repeat(np.tile(np.linspace(0.03, 0.2, 20), 2), 3)
    runs = record(periods, np.repeat([0.3, 0.7], 60), 20)
    theta = kind.nominal() | DAMPED
    first = runs.with_column(
        kind.quantity, kind.predict(runs, theta) * (1 + 0.03 * np.random.default_rng(0).normal(size=120))
    )
    again = [kind.residual(kind.imitate(first, theta, np.random.default_rng(seed)), theta) for seed in range(10)]
    assert {len(r) for r in again} == {40}
    assert np.mean(np.square(again)) == pytest.approx(1, abs=0.2)
    shifted = first.with_column(kind.quantity, kind.predict(first, theta) + 3e-3)
    assert kind.error([shifted], [kind.predict(shifted, theta)]) == pytest.approx(3e-3)
    drawn = [kind.imitate(first, theta, np.random.default_rng(seed)) for seed in range(10)]
    errors = [kind.error([one], [kind.predict(one, theta)]) for one in drawn]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(kind.noise_floor([first]), rel=0.15)
    stated = parse_rig({**RIG, "noise": {"velocity_std_m_s": 5e-4}})
    assert 5e-4 < VibroTableKind.from_rig(stated).noise_floor([first]) < 8e-4


def test_folds_keep_conditions_whole_and_lose_no_row() -> None:
    kind = KIND
    runs = [record(np.repeat(np.linspace(0.03, 0.2, 18), 3), 0.3, 20), record(np.repeat([0.03, 0.5], 4), 0.3, 20)]
    seen = 0
    for training, held in kind.splits(runs):
        left = {(p, d) for r in training for p, d in zip(r["period_s"], r["duty"], strict=True)}
        out = {(p, d) for r in held for p, d in zip(r["period_s"], r["duty"], strict=True)}
        assert not left & out
        seen += sum(len(r) for r in held)
        assert sum(len(r) for r in training) + sum(len(r) for r in held) == 62
    assert seen == 62


def test_the_mirror_is_settled_from_records() -> None:
    kind = KIND
    periods = np.tile(np.linspace(0.04, 0.15, 15), 2)
    runs = record(periods, np.repeat([0.3, 0.7], 15), 40)
    for mirror in (1.0, -1.0):
        made = runs.with_column(kind.quantity, kind.predict(runs, Theta.of({**DAMPED, "mirror": mirror})))
        assert kind.settled([made]).nominal()["mirror"] == mirror


def test_bad_input_says_what_would_be_right() -> None:
    with pytest.raises(ValueError, match="effect must be one that acts"):
        KIND.predict(record(0.06, 0.3, 10), Theta.of({("tissue_drying", "rate"): 1.0}))


# period ms, duty, cycles, mean velocity mm/s: means of the repeats of a measured spring-and-magnet capsubot
MEASURED = (
    (30, 0.3, 100, 1.0), (30, 0.7, 100, -3.67), (40, 0.7, 100, -6.69), (50, 0.3, 100, 5.7), (55, 0.3, 100, 5.58),
    (60, 0.25, 100, 3.17), (60, 0.35, 100, 10.89), (60, 0.5, 100, 2.72), (60, 0.65, 100, -9.83), (60, 0.75, 100, -6.28),
    (80, 0.3, 50, -3.81), (80, 0.7, 50, 15.42), (90, 0.3, 40, -18.7), (95, 0.7, 40, 34.74), (100, 0.15, 40, -1.92),
    (100, 0.25, 40, -35.58), (100, 0.4, 40, -27.25), (100, 0.6, 40, 17.5), (100, 0.75, 40, 31.67), (100, 0.9, 40, 2.25),
    (110, 0.7, 40, 27.12), (115, 0.3, 40, -28.26), (135, 0.3, 40, -26.48), (135, 0.7, 40, 14.2), (155, 0.3, 20, -19.78),
    (175, 0.7, 20, 7.43), (200, 0.7, 20, -1.12), (320, 0.7, 20, -0.78),
)  # fmt: skip


def test_measured_runs_reverse_direction_where_the_damped_model_does_and_the_nominal_one_does_not() -> None:
    period, duty, cycles, speed = np.array(MEASURED).T
    table = record(period * 1e-3, duty, cycles, speed * 1e-3)
    kind = KIND.settled([table])
    assert kind.nominal()["mirror"] == -1.0
    assert kind.error([table], [kind.predict(table, kind.nominal())]) > 15e-3
    assert kind.error([table], [kind.predict(table, DAMPED)]) < 5.5e-3
    assert reversal(kind, DAMPED) == pytest.approx(0.076, abs=0.003)
    assert reversal(kind, kind.nominal()) == pytest.approx(0.090, abs=0.003)


@pytest.mark.slow
def test_the_loop_finds_the_damping_in_measured_runs_and_says_what_it_is_worth() -> None:
    period, duty, _, speed = np.array([row for row in MEASURED if row[0] <= 135]).T
    table = record(period * 1e-3, duty, 8, speed * 1e-3)
    kind = replace(KIND.settled([table]), effects=(SpringDamping, PlateAsymmetry, InclineGravity))
    found = search(kind, [table], lambda *_: None, np.random.default_rng(0))
    assert found.effects[0] == "spring_damping"
    assert found.before - found.after > 0.6 * (found.before - found.null_cost)
    theta = kind.nominal() | found.augmented.theta
    assert kind.error([table], [kind.predict(table, theta)]) < 6.5e-3
    turn, believed = reversal(kind, theta), reversal(kind, kind.nominal())
    assert turn is not None
    assert believed is not None
    assert turn < believed - 0.005
    worth = cross_validated(kind, theta.only(["spring_damping"]), [table])
    assert worth["spring_damping"] > 2 * worth[""]


def test_the_rig_file_gives_the_same_kind_and_a_gut_is_refused() -> None:
    tables = {
        "capsule": {"mass_kg": 0.193},
        "drive": {
            "inner_mass_kg": 0.074,
            "spring_stiffness_N_per_m": 256.23,
            "force_N": 1.25,
            "reaction_on_body": True,
        },
        "surface": {"kind": "plate", "friction_coefficient": 0.29},
        "rig": {"kind": "vibro_table"},
    }
    rig = parse_rig(tables)
    assert VibroTableKind.from_rig(rig).nominal()["friction_coefficient"] == 0.29
    with pytest.raises(ValueError, match="rig must have a drive and a plate"):
        VibroTableKind.from_rig(replace(rig, drive=None))


def test_words_name_the_reversal_the_scale_and_the_coil() -> None:
    kind = MIRRORED
    theta = Theta.of({**DAMPED, ("coil_reach", "gain_per_m"): -20.0})
    runs = record([0.06, 0.06, 0.1], 0.3, 40, [5e-3, 6e-3, -30e-3])
    said = " ".join(
        report.statements(kind, {"nominal": kind.nominal(), "calibrated": kind.nominal(), "augmented": theta}, [runs])
    )
    assert "reverses direction" in said
    assert "scale error" in said
    assert "3.16 N on the inner mass at rest, with 2.59 N at 10 mm" in said
    assert "differ by up to 1 mm/s" in said
    equations = " ".join(map(line_text, report.equations(kind, theta)))
    assert "a lagging coil current: u = i^2; 0.002788 i' = sqrt(u_cmd) - i" in equations
    assert "coil scale = exp(-20 xi)" in equations
    assert "ring-down" in str(report.next_experiment(kind, theta, [runs], {"spring_damping": ("guide_friction",)}))
    assert report.next_experiment(kind, theta, [runs], {"spring_damping": ()}) is None
