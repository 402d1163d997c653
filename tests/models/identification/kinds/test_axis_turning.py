"""An axis that turns, and what a record tells of an axis: ranges, noise, rests, a logged speed and load."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from models.checks.excitation import cannot_show, inseparable
from models.effects import CATALOGUE
from models.effects.conformance import first_failure
from models.formula import line_text
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.zero_phase import decimate
from models.identification.kinds.reports import axis as report
from models.identification.rehearsal import left_by, rehearsed
from models.identification.verdict import within
from models.records.record import Record, read_record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from models.theta import Theta

RIG = Rig("axis")
BASE = Theta(
    {
        "inertia_kg_m2": 0.4,
        "viscous_friction_N_m_s_per_rad": 1.2,
        "coulomb_friction_N_m": 2.0,
        "offset_N_m": 0.2,
    }
)
GRAVITY = Theta.of({("gravity_over_angle", "torque_N_m"): 8.0, ("gravity_over_angle", "hanging_rad"): 0.4})


def swing(seconds: float = 12.0, rate: float = 500.0) -> tuple[np.ndarray, ...]:
    """Time, angle, speed and acceleration of two tones that do not repeat within the record."""
    t = np.arange(0, seconds, 1 / rate)
    turns, size = 2 * np.pi * np.array([[0.11], [0.47]]), np.array([[0.9], [0.3]])
    x = np.sum(size * np.sin(turns * t), axis=0)
    return (
        t,
        x,
        np.sum(size * turns * np.cos(turns * t), axis=0),
        np.sum(-size * turns**2 * np.sin(turns * t), axis=0),
    )


def joint(torque_noise: float = 0.05, angle_noise: float = 0.0, gravity: float = 8.0, seed: int = 0) -> Record:
    """The record of a joint with a weight that hangs at 0.4 rad, from its own formula."""
    rng = np.random.default_rng(seed)
    t, x, v, a = swing()
    torque = 0.4 * a + 1.2 * v + 2.0 * np.sign(v) + 0.2 + gravity * np.sin(x - 0.4)
    columns = {
        "t_s": t,
        "angle_rad": x + angle_noise * rng.standard_normal(len(t)),
        "torque_N_m": torque + torque_noise * rng.standard_normal(len(t)),
    }
    return Record("joint", "axis", columns)


@pytest.mark.parametrize("angle_noise", [0.0, 3e-4])
def test_the_weight_on_a_joint_is_found_with_the_joints_numbers(angle_noise: float) -> None:
    record = joint(angle_noise=angle_noise)
    kind = AxisKind.from_rig(RIG, [record])
    start = Theta.of({name: 1.3 * value for name, value in {**BASE, **GRAVITY}.items()})
    theta = Fitter.of(kind, [record], ["gravity_over_angle"]).far([start]).theta
    assert {name: theta[name] for name in BASE} == pytest.approx(BASE, rel=0.03, abs=0.03)
    assert {name: theta[name] for name in GRAVITY} == pytest.approx(GRAVITY, rel=0.02)
    assert np.mean(kind.residual(record, theta) ** 2) < 1.4


def test_a_noisy_angle_narrows_the_band_and_its_noise_is_counted() -> None:
    clean, noisy = joint(), joint(angle_noise=3e-4)
    assert AxisKind.from_rig(RIG, [clean]).band == 20.0
    kind = AxisKind.from_rig(RIG, [noisy])
    assert kind.band < 20.0
    assert f"{2 * kind.band:g} Hz" in kind.measure
    theta = Theta.of({**BASE, **GRAVITY})
    imitated = kind.imitate(noisy, theta, np.random.default_rng(3))
    for record in (noisy, imitated):
        assert np.mean(kind.residual(record, theta) ** 2) == pytest.approx(1.0, abs=0.35)


def test_a_torque_that_is_the_command_claims_no_floor() -> None:
    command = joint(torque_noise=0.0)
    t = command["t_s"]
    repeating = command.with_column("angle_rad", np.sin(np.pi * t)).with_column("torque_N_m", np.cos(np.pi * t))
    for record in (command, repeating):
        kind = AxisKind.from_rig(RIG, [record])
        assert np.isnan(kind.noise(record).force)
        assert np.isnan(kind.noise_floor([record]))
        said = report.statements(kind, {"calibrated": kind.nominal()}, [record])
        assert "No floor is claimed" in said[0]
        assert "Repeats" not in said[0]
    assert AxisKind.from_rig(RIG, [joint()]).noise_floor([joint()]) > 0
    stated = parse_rig({"rig": {"kind": "axis"}, "noise": {"torque_std_N_m": 0.1}})
    assert AxisKind.from_rig(stated, [command]).noise_floor([command]) > 0


@pytest.mark.parametrize(("share", "right"), [(0.0, True), (0.01, True), (0.05, False)])
def test_a_law_may_leave_a_tenth_of_the_noise_correlated(share: float, right: bool) -> None:
    """`share` of the record's noise; residuals are means of several samples, of whose noise it is seven times that."""
    clean, noisy = (joint(torque_noise=noise, gravity=0.0) for noise in (0.0, 0.05))
    noise = noisy["torque_N_m"] - clean["torque_N_m"]
    slow = np.sqrt(2 * share) * noise.std() * np.sin(np.arange(len(noise)) / 30)
    record = noisy.with_column("torque_N_m", noisy["torque_N_m"] + slow)
    stated = parse_rig({"rig": {"kind": "axis"}, "noise": {"torque_std_N_m": 0.05}})
    kind = AxisKind.from_rig(stated, [record])
    *_, (null,) = rehearsed(kind, [record], [], BASE, [], np.random.default_rng(0))
    (left,) = left_by(kind, [record], [], BASE, 1.0, kind.final)
    checks = {check.id: check.ok for check in within(left, null)}
    assert checks["whiteness"] is right


def test_ranges_follow_from_the_record_and_not_from_the_unit() -> None:
    record = joint()
    larger = record.with_column("torque_N_m", 1e3 * record["torque_N_m"])
    kinds = [AxisKind.from_rig(RIG, [one]) for one in (record, larger)]
    for p, q in zip(kinds[0].base, kinds[1].base, strict=True):
        assert (q.lower, q.value, q.upper) == pytest.approx((1e3 * p.lower, 1e3 * p.value, 1e3 * p.upper))
    weights = [next(e for e in kind.effects if e.id == "gravity_over_angle").amplitude().upper for kind in kinds]
    assert weights[1] == pytest.approx(1e3 * weights[0])


def test_effects_about_an_axis_have_its_units_and_pass_the_conformance_tests() -> None:
    record = joint()
    kind = AxisKind.from_rig(RIG, [record])
    ids = {e.id for e in kind.effects}
    assert {"gravity_over_angle", "spring_over_position", "load_dependent_friction", "stribeck"} <= ids
    for effect in kind.effects:
        assert first_failure(effect, set(CATALOGUE)) is None
        for p in effect.parameters():
            assert not p.name.endswith(("_m", "_m_s", "_per_m")) or "_N_m" in p.name, p.name
    theta = Theta.of(
        {
            **BASE,
            **GRAVITY,
            ("stribeck", "excess"): 0.5,
            ("stribeck", "speed_rad_s"): 0.05,
            ("stribeck", "exponent"): 2.0,
        }
    )
    theta |= {("spring_over_position", "stiffness_N_m_per_rad"): 3.0}
    v = kind.signals(record)["v_rad_s"]
    extra = kind.predict(record, theta) - kind.predict(record, theta.without("stribeck"))
    assert extra == pytest.approx((1.2 * v + 2.0 * np.sign(v)) * 0.5 * np.exp(-((v / 0.05) ** 2)), abs=0.02)
    text = " ".join(map(line_text, report.equations(kind, theta)))
    assert "T = 0.4 a" in text
    assert "T_extra = -8 sin(x - 0.4)" in text
    assert "gravity_over_angle" not in {e.id for e in AxisKind.from_rig(RIG).effects}


def test_a_place_where_the_axis_rests_counts_for_nothing() -> None:
    record = joint()
    t = record["t_s"]
    held = Record(
        "held",
        "axis",
        {
            "t_s": np.concatenate([t - t[-1] - 0.002, t]),
            "angle_rad": np.concatenate([np.full(len(t), record["angle_rad"][0]), record["angle_rad"]]),
            "torque_N_m": np.concatenate([np.full(len(t), 1.3), record["torque_N_m"]]),
        },
    )
    kind = AxisKind.from_rig(RIG, [held])
    half = len(kind.residual(held, Theta.of({**BASE, **GRAVITY}))) // 2
    assert (
        np.max(np.abs(kind.residual(held, Theta.of({**BASE, **GRAVITY}))[: half - 80])) < 1e-2
    )  # the tail of the filter
    assert np.mean(kind.residual(held, Theta.of({**BASE, **GRAVITY}))[half + 80 :] ** 2) < 2


def test_a_logged_load_makes_friction_grow_and_a_logged_speed_is_used_where_it_agrees() -> None:
    t, _, v, _ = swing()
    record = joint(torque_noise=0.0, gravity=0.0)
    loaded = record.with_column("load_N_m", 12 + 10 * np.sin(0.3 * t))
    kind = AxisKind.from_rig(RIG, [loaded])
    theta = Theta.of({**BASE, ("load_dependent_friction", "growth_per_load"): 0.05})
    extra = kind.predict(loaded, theta) - kind.predict(loaded, BASE)
    assert extra == pytest.approx((1.2 * v + 2 * np.sign(v)) * 0.05 * loaded["load_N_m"], abs=0.1)
    assert "load_N_m" in kind.signals(loaded)
    assert "no load is logged" in cannot_show(RIG, [record], kind.effects)["load_dependent_friction"]
    assert "load_dependent_friction" not in cannot_show(RIG, [loaded], kind.effects)
    slightly = record.with_column("velocity_rad_s", 1.01 * v)
    assert kind.signals(slightly)["v_rad_s"] == pytest.approx(1.01 * v, abs=5e-3)
    degrees = record.with_column("velocity_rad_s", np.degrees(v))
    assert kind.signals(degrees)["v_rad_s"] == pytest.approx(v, abs=5e-3)


def write(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns), comments="")
    return path


def test_records_with_angle_and_torque_are_read_as_an_axis_that_turns(tmp_path: Path) -> None:
    record = joint()
    rig = parse_rig({"rig": {"kind": "axis"}, "axis": {"inertia_kg_m2": 0.5}})
    read = read_record(write(tmp_path / "r.csv", record.columns), rig)
    kind = kind_for(rig, [read])
    assert kind.quantity == "torque_N_m"
    assert kind.nominal()["inertia_kg_m2"] == 0.5
    renamed = {"time": record["t_s"], "q_deg": np.degrees(record["angle_rad"]), "tau [Nm]": record["torque_N_m"]}
    maps = {"t_s": "time", "angle_rad": {"column": "q_deg", "unit": "deg"}, "torque_N_m": "tau [Nm]"}
    mapped = read_record(write(tmp_path / "d.csv", renamed), parse_rig({"rig": {"kind": "axis"}, "columns": maps}))
    assert mapped["angle_rad"] == pytest.approx(record["angle_rad"])
    with pytest.raises(ValueError, match="must have the column torque_N_m"):
        read_record(write(tmp_path / "no.csv", {k: v for k, v in record.columns.items() if "torque" not in k}), rig)


def test_a_line_and_an_axis_that_turns_are_not_mixed() -> None:
    record = joint()
    columns = {"t_s": record["t_s"], "position_m": record["angle_rad"], "force_N": record["torque_N_m"]}
    with pytest.raises(ValueError, match="records of one axis must all have position_m or all angle_rad"):
        AxisKind.from_rig(RIG, [record, Record("line", "axis", columns)])
    with pytest.raises(ValueError, match=r"\[axis\] mass_kg must not be there for records with angle_rad"):
        AxisKind.from_rig(parse_rig({"rig": {"kind": "axis"}, "axis": {"mass_kg": 3.0}}), [record])
    assert len(decimate(record["torque_N_m"], 500.0)) > 0


def test_over_less_than_a_quarter_turn_a_weight_on_a_lever_is_a_spring() -> None:
    whole, effects = joint(), CATALOGUE.acting_on("axis")
    little = whole.with_column("angle_rad", 0.4 * whole["angle_rad"])
    assert inseparable(RIG, [whole], effects) == {}
    classes = inseparable(RIG, [little], effects)
    assert "spring_over_position" in classes["gravity_over_angle"]
    assert "gravity_over_angle" in classes["spring_over_position"]
    assert "stribeck" not in classes
