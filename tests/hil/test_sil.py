"""`capsule sil`: what it prints, that it is deterministic, that nobody waits for a dead node, and that it tracks as `track` does."""

import json
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest

from controller.signals import Action
from hil.app.main import run as capsule
from hil.app.sil_bench import PHASE_S, Bench
from hil.app.sil_loop import run_sil
from hil.app.sil_scenario import load_sil_scenario, parse_sil_scenario
from hil.app.track_loop import believed_model, run_loop
from hil.app.track_score import score
from hil.bus.protection import Receiver, Reception
from hil.nodes.controller import FAULTY, RUNNING, ControllerNode, Task
from hil.nodes.plant import SLOT_S
from hil.nodes.power import CarriagePower
from hil.nodes.wiring import BOOT, ENABLE, ENABLED, FAULT, QUICK_STOP_M_S2, STANDBY, frames
from plant import layout as at
from plant.rig import Coil
from tests.hil.sil_runs import RIGS, model_of, run, scenario_of

SCENARIOS = sorted((Path(__file__).parents[2] / "hil" / "scenarios").glob("*_*.toml"))
SHORT = """
[scenario]
name = "short"
duration_s = 0.6
[rig]
kind = "magnetic"
[reference]
kind = "ramp"
speed_mm_s = 2.0
start_s = 0.1
[control]
judged_from_s = 0.2
[[faults]]
kind = "killed"
at_s = 0.5
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Half a second on the bus, then a dead controller."""
    path = tmp_path / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return path


def test_json_has_the_keys_that_others_rely_on(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert capsule(["sil", str(short), "--json", "--seed", "3", "--out", str(tmp_path / "out")]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == [
        *("scenario", "controller", "seed", "model", "tracking_rmse_m", "tracking_max_m", "final_error_m", "mean_speed_m_s"),
        *("reference_mean_speed_m_s", "wall_force_max_N", "effort", "hard_violations", "solve_ms", "real_time_factor", "log"),
        *("bus", "faults"),
    ]
    assert (found["scenario"], found["controller"], found["seed"], found["model"]) == ("short", "feedforward", 3, "nominal")
    assert list(found["bus"]) == ["frames", "load", "rejected"]
    assert found["bus"]["frames"] > 800
    assert 0.1 < found["bus"]["load"] < 0.32
    assert [list(fault) for fault in found["faults"]] == [["fault", "at_s", "safe_after_ms", "unsafe"]]
    assert 5 < found["faults"][0]["safe_after_ms"] <= 25
    assert json.loads((tmp_path / "out" / "sil.json").read_text(encoding="utf-8")) == found


def test_the_log_can_be_replayed_bit_by_bit(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The controller on its own log sends the same frames again, late solutions included."""
    late = '\n[[faults]]\nkind = "late_solve"\nat_s = 0.3\nduration_s = 0.003\n'
    short.write_text(SHORT + late, encoding="utf-8")
    assert capsule(["sil", str(short), "--out", str(tmp_path / "out"), "--json"]) == 0
    log = json.loads(capsys.readouterr().out)["log"]
    assert capsule(["replay", log, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["identical"]
    assert found["ticks"] == 250


def test_summary_names_the_fault(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert capsule(["sil", str(short)]) == 0
    out = capsys.readouterr().out
    assert "fault killed at 0.5 s: safe after" in out
    assert "UNSAFE" not in out


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('kind = "killed"', "did you mean 'killed'"),
        ('kind = "ramp"', "reference.kind must be one of"),
        ("[control]", "tables must be among"),
        ('kind = "magnetic"', "to be controlled; got 'pull'"),
    ],
)
def test_bad_scenarios_end_with_one_sentence(short: Path, capsys: pytest.CaptureFixture[str], change: str, words: str) -> None:
    other = {'kind = "killed"': 'kind = "kiled"', 'kind = "ramp"': 'kind = "rump"', "[control]": "[contrl]"}
    short.write_text(SHORT.replace(change, other.get(change, 'kind = "pull"')), encoding="utf-8")
    assert capsule(["sil", str(short)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_shipped_scenarios_can_be_read(path: Path) -> None:
    """Those of track too; the tick is the bus's where the file names none."""
    if path.stem.startswith(("track_", "sil_")):
        scenario, text = load_sil_scenario(path)
        assert scenario.loop.control.tick_s == 2e-3 or "tick_s" in text


@pytest.mark.parametrize("kind", RIGS)
def test_same_seed_same_frames(kind: str) -> None:
    """Every frame on the wire and its time, to the bit; another seed gives others."""
    faults = ({"kind": "corrupt", "at_s": 0.2, "duration_s": 0.05, "value": 0.3}, {"kind": "drop", "at_s": 0.3, "target": "all"})
    first, second, other = (run(kind, 0.4, *faults, seed=seed)[0] for seed in (1, 1, 2))
    assert first.digest == second.digest
    assert first.digest != other.digest
    assert np.array_equal(first.rows, second.rows)


def test_tracks_over_the_bus_as_without_it() -> None:
    """One tick's delay is in the model, so that tracking is within a tenth of what it is with none at the same tick."""
    scenario = scenario_of("magnetic", 3.0)
    with_bus = score(scenario.loop, run_sil(scenario, model_of("magnetic"), "feedforward", 1))
    without = score(scenario.loop, run_loop(scenario.loop, believed_model(scenario.loop, {}), "feedforward", 1))
    assert with_bus.tracking_rmse_m <= 1.1 * without.tracking_rmse_m + 2e-5
    assert with_bus.hard_violations == 0


def test_force_sensor_speaks_where_wanted() -> None:
    quiet, loud = run("magnetic", 0.2)[0], run("magnetic", 0.2, bus={"force_sensor": True})[0]
    assert loud.frames - quiet.frames == pytest.approx(0.2 * (500 + 50), abs=12)


def test_a_run_without_end_is_failed_by_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.app.sil_loop._LEAST_S", 1e-6)
    with pytest.raises(ValueError, match="by the wall clock"):
        run("magnetic", 0.2, bus={"longest_s_per_s": 1e-6})


def test_bus_table_is_checked() -> None:
    with pytest.raises(ValueError, match=r"bus\.longest_s_per_s must be positive"):
        scenario_of("magnetic", 0.2, bus={"longest_s_per_s": 0.0})
    with pytest.raises(ValueError, match=r"must be a multiple of 0\.001 s"):
        parse_sil_scenario({"scenario": {"name": "a", "duration_s": 1.0}, **RIGS["coil"], "control": {"tick_s": 1.5e-3}})
    with pytest.raises(ValueError, match="bus must be a table"):
        scenario_of("magnetic", 0.2, bus=3)


def test_a_coil_inside_the_capsule_has_no_frame() -> None:
    scenario = scenario_of("vibro", 0.3)
    drive = replace(scenario.loop.truth.drive, coil=Coil())
    other = replace(scenario, loop=replace(scenario.loop, truth=replace(scenario.loop.truth, drive=drive)))
    with pytest.raises(ValueError, match="on the bus must be"):
        Bench(other, model_of("vibro"), "vibro", 1)


def bench_of(kind: str = "magnetic") -> Bench:
    """A bench whose controller has not been started."""
    return Bench(scenario_of(kind, 5.0), model_of(kind), "vibro" if kind == "vibro" else "feedforward", 1)


def go(bench: Bench, seconds: float) -> None:
    """Some ticks."""
    for _ in range(round(seconds / bench.tick_s)):
        bench.begin_tick()
        for k in range(bench.slots):
            bench.slot(k)
        bench.end_tick()


@pytest.mark.parametrize("kind", RIGS)
def test_start_stop_fault_and_start_again(kind: str) -> None:
    """Nothing moves before the operator's word; a stop is controlled; after a fault it takes another word and a reset."""
    bench = bench_of(kind)
    node, drive = bench.node, bench.plant.drive
    go(bench, 0.2)
    assert drive.stage.state == STANDBY
    node.start(bench.time_s)
    go(bench, 0.3)
    assert drive.stage.state == ENABLED
    node.stop()
    go(bench, 0.1)
    assert (drive.stage.state, drive.safe) == (STANDBY, True)
    node.start(bench.time_s)
    go(bench, 0.1)
    assert drive.stage.state == ENABLED
    bench.ticks += 15
    go(bench, 0.1)
    assert (drive.stage.state, node.state) == (FAULT, FAULTY)
    go(bench, 0.2)
    assert drive.stage.state == FAULT
    node.start(bench.time_s)
    go(bench, 0.2)
    assert (drive.stage.state, node.state, node.reason) == (ENABLED, RUNNING, "")


def test_dry_run_sends_nothing() -> None:
    bench = bench_of()
    task = Task(model_of("magnetic"), "feedforward", bench.scenario.loop.reference, bench.scenario.loop.limits)
    seen: list[can.Message] = []
    bench.node = ControllerNode(task, bench.ports["controller"], dry_run=True, observer=seen.append)
    bench.node.start(0.0)
    go(bench, 0.1)
    assert bench.ports["controller"].counters.sent == 0
    assert any(not m.is_rx for m in seen)
    assert any(m.is_rx for m in seen)
    assert bench.plant.drive.stage.state in (BOOT, STANDBY)


class Wild:
    """A controller that answers anything, or nothing."""

    name = "wild"

    def __init__(self) -> None:
        self.rng = np.random.default_rng(5)

    def reset(self, *_: object) -> None:
        """Nothing to remember."""

    def act(self, *_: object) -> object:
        """NaN, infinities, jumps, other types, exceptions."""
        kind = int(self.rng.integers(8))
        if kind == 0:
            raise RuntimeError("wild")
        values = (float("nan"), float("inf"), -1e9, 1e9, "text", None, float(self.rng.normal()))
        return Action(values[kind - 1], "ok") if kind != 7 else Action(float(self.rng.normal()), "ok")


@pytest.mark.parametrize("kind", RIGS)
def test_whatever_the_controller_does_nothing_unsafe_leaves(kind: str) -> None:
    """The supervisor taken out, a wild controller straight on the guard: what is on the wire is within range and slew all the same."""
    bench = bench_of(kind)
    wild, node = Wild(), bench.node
    node.supervisor = wild  # type: ignore[assignment]
    original = node.supervisor.act

    def act(*words: object) -> object:
        try:
            return original(*words)
        except RuntimeError:
            return Action(float("nan"), "failed")

    wild.act = act  # type: ignore[method-assign]
    wild.active = "wild"  # type: ignore[attr-defined]
    frame = frames()[bench.wiring.command]
    reception, told = Reception({frame.id: Receiver(frame)}), []

    def look(message: can.Message) -> None:
        if message.arbitration_id == frame.id and not message.is_rx:
            told.append(reception.accept(frame.id, message.data, message.timestamp))

    node.guard._observe = look
    for k in range(20):
        node.start(bench.time_s, 0.0)
        go(bench, 0.05)
        assert (k < 2) or node.state in (RUNNING, FAULTY)
    fence, moving = node.guard.fence, [v for v in told if isinstance(v, dict)]
    assert len(moving) == len(told) == 500
    values = np.array([v[bench.wiring.signal] for v in moving])
    enabled = np.array([v["Mode"] == ENABLE for v in moving])
    assert enabled.sum() > 20
    assert values.min() >= fence.low - 1e-6
    assert values.max() <= fence.high + 1e-6
    steps = np.abs(np.diff(values))[enabled[1:] & enabled[:-1]]
    assert steps.max() <= fence.rate * bench.tick_s * (1 + 1e-6) + 2 * frame.field(bench.wiring.signal).scale
    rows = np.concatenate(bench.plant.session.rows)
    if kind == "coil":
        assert np.abs(rows[:, at.O_CURRENT]).max() <= 1.3


class Full:
    """A controller that asks for all there is."""

    active = "full"
    temperature_C = 20.0

    def reset(self, *_: object) -> None:
        """Nothing to remember."""

    def act(self, *_: object) -> Action:
        """More than any range allows."""
        return Action(9.0)


@pytest.mark.parametrize(("kind", "allowed_s"), [("magnetic", 0.020), ("coil", 0.010), ("vibro", 0.010)])
@pytest.mark.parametrize("phase", [0, 1])
def test_from_full_power_to_the_safe_state_when_the_controller_dies(kind: str, allowed_s: float, phase: int) -> None:
    """The carriage at its full speed, the coil at its full current: from the last good frame to rest within what the drive is allowed."""
    bench = bench_of(kind)
    bench.node.supervisor = Full()  # type: ignore[assignment]
    bench.node.start(0.0, 0.0)
    go(bench, 0.2)
    drive, power = bench.plant.drive, bench.plant.drive.power
    if isinstance(power, CarriagePower):
        assert power.rate == pytest.approx(bench.node.guard.fence.rate)
    else:
        assert power.output == pytest.approx(bench.node.guard.fence.high, rel=0.02)
    if phase:
        bench.slot(0)
        bench.medium.advance(bench.time_s + bench.tick_s)
    now = bench.time_s + (2 if phase else 0) * SLOT_S + PHASE_S
    while not drive.safe:
        bench.medium.advance(now)
        bench.plant.tick(now)
        now += SLOT_S
    assert now - drive.good_at <= allowed_s


@pytest.mark.parametrize(("kind", "silent_ticks"), [("magnetic", 1), ("magnetic", 3), ("magnetic", 7), ("coil", 1), ("coil", 2)])
def test_a_pause_within_the_commands_life_is_ridden_through(kind: str, silent_ticks: int) -> None:
    """The controller gets no processor for some ticks: the drive lives on its last command, the node catches up and goes on."""
    bench = bench_of(kind)
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    restarts = bench.node.estimator.counts.restarts
    pause(bench, silent_ticks)
    go(bench, 0.2)
    assert (bench.node.state, bench.node.reason) == (RUNNING, "")
    assert bench.plant.drive.stage.state == ENABLED
    assert bench.plant.drive.rejected == 0
    assert bench.node.estimator.counts.restarts == restarts
    estimate = bench.node.tick(bench.time_s).estimate
    truth = np.concatenate(bench.plant.session.rows)[-1, at.O_X]
    assert abs(estimate.state[0] - truth) < 0.5e-3


@pytest.mark.parametrize(("kind", "silent_ticks"), [("magnetic", 9), ("magnetic", 15), ("coil", 3), ("coil", 15)])
def test_a_longer_pause_is_told_from_a_jump_of_the_clock(kind: str, silent_ticks: int) -> None:
    """Both stop the drive for good; in a pause the drive's reports have filled the time, in a jump nobody has said anything."""
    paused, jumped = bench_of(kind), bench_of(kind)
    for bench in (paused, jumped):
        bench.node.start(0.0, 0.0)
        go(bench, 0.3)
    pause(paused, silent_ticks)
    paused.begin_tick()
    jumped.node.tick(jumped.time_s + silent_ticks * jumped.tick_s)
    assert (paused.node.state, paused.node.reason) == (FAULTY, "controller paused")
    assert (jumped.node.state, jumped.node.reason) == (FAULTY, "clock jumped")
    for bench in (paused, jumped):
        go(bench, 0.1)
        assert bench.plant.drive.safe


@pytest.mark.parametrize("late_s", [0.4e-3, 1.1e-3, 1.9e-3])
def test_a_late_tick_is_still_its_own(late_s: float) -> None:
    """Each third tick begins late, the next one on time and so after less than a period: no tick is missed, none counts twice."""
    bench = bench_of("magnetic")
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    ahead = []
    for k in range(200):
        tick = bench.node.tick(bench.time_s + (late_s if k % 3 == 1 else 0.0))
        pause(bench, 1)
        ahead.append(tick.estimate.state[0] - np.concatenate(bench.plant.session.rows)[-1, at.O_X])
    assert (bench.node.state, bench.node.reason) == (RUNNING, "")
    assert bench.node.estimator.counts.restarts == 0
    assert np.abs(ahead).max() < 0.5e-3


def test_a_fast_carriage_s_command_lives_shorter_by_the_time_to_brake() -> None:
    """The whole way to rest takes 18 ms at most, whatever the speed; what the node rides through follows."""
    wiring = bench_of("magnetic").wiring
    for speed in np.linspace(-0.25, 0.25, 21):
        assert wiring.life_ms(speed) + 1e3 * abs(speed) / QUICK_STOP_M_S2 <= 18
    assert (wiring.life_ms(0.0), wiring.life_ms(0.25)) == (18, 8)
    bench = bench_of("magnetic")
    bench.node.supervisor = Full()  # type: ignore[assignment]
    bench.node.start(0.0, 0.0)
    go(bench, 0.3)
    pause(bench, 5)
    bench.begin_tick()
    assert (bench.node.state, bench.node.reason) == (FAULTY, "controller paused")


def pause(bench: Bench, ticks: int) -> None:
    """Let time go on without the controller."""
    for _ in range(ticks):
        for number in range(bench.slots):
            bench.slot(number)
        bench.end_tick()


@pytest.mark.parametrize("strange", [float("nan"), float("inf"), -1e300, 1e300])
def test_a_strange_clock_stops_and_raises_nothing(strange: float) -> None:
    bench = bench_of()
    bench.node.start(0.0, 0.0)
    go(bench, 0.2)
    assert bench.plant.drive.stage.state == ENABLED
    bench.node.tick(strange)
    assert (bench.node.state, bench.node.reason) == (FAULTY, "clock jumped")
    go(bench, 0.1)
    assert bench.plant.drive.safe


def test_led_only_by_fresh_localisation() -> None:
    """Without localisation the drive gets ready and no further."""
    trace, _ = run("coil", 0.4, {"kind": "lost", "at_s": 0.0, "duration_s": 9.0})
    assert not np.any(trace.slots[:, 1] == 0)
