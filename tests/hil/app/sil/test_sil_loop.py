"""A run over the bus: deterministic, tracks as a run without a bus does, speaks and moves only as wanted, and comes to
an end.
"""

import signal
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hil.app.scenario.bus_scenario import load_sil_scenario
from hil.app.sil.loop import DONE, run_sil
from hil.app.sil.testbed import believed_on_bus
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta
from tests.hil.app.sil.sil_runs import RIGS, Digest, model_of, run, scenario_of
from tests.places import SCENARIOS


@pytest.mark.parametrize("kind", RIGS)
def test_same_seed_same_frames(kind: str) -> None:
    """Every frame on the wire and its time, to the bit; another seed gives others."""
    faults = (
        {"kind": "corrupt", "at_s": 0.2, "duration_s": 0.05, "value": 0.3},
        {"kind": "drop", "at_s": 0.3, "target": "all"},
    )
    scenario, rows, digests = scenario_of(kind, 0.4, *faults), [], []
    for seed in (1, 1, 2):
        digest = Digest()
        trace = run_sil(scenario, model_of(kind), scenario.loop.control.controller, seed, shown=digest)
        rows.append(trace.rows)
        digests.append(digest.told())
    assert digests[0] == digests[1]
    assert digests[0] != digests[2]
    assert np.array_equal(rows[0], rows[1])


def test_tracks_over_the_bus_as_without_it() -> None:
    """One tick's delay is in the model, so that tracking is within a tenth of what it is with none at the same tick."""
    scenario = scenario_of("magnetic", 3.0)
    with_bus = score(scenario.loop, run_sil(scenario, model_of("magnetic"), "feedforward", 1))
    without = score(scenario.loop, run_loop(scenario.loop, believed_model(scenario.loop, Theta()), "feedforward", 1))
    assert with_bus.tracking_rmse_m <= 1.1 * without.tracking_rmse_m + 2e-5
    assert with_bus.hard_violations == 0


@pytest.mark.parametrize("name", ["track_vibro_gut", "track_vibro_gut_2", "demo_vibro"])
def test_an_inner_mass_runs_to_its_end(name: str) -> None:
    """A slow way, a way back, a model that is off: no contradiction of sensor and drive."""
    scenario, _ = load_sil_scenario(SCENARIOS / f"{name}.toml")
    trace = run_sil(scenario, believed_on_bus(scenario, Theta()), "vibro", scenario.loop.seed)
    assert trace.ended == DONE


def test_force_sensor_speaks_where_wanted() -> None:
    quiet, loud = run("magnetic", 0.2)[0], run("magnetic", 0.2, bus={"force_sensor": True})[0]
    assert loud.frames - quiet.frames == pytest.approx(0.2 * (500 + 50), abs=12)


def test_a_run_without_end_is_failed_by_the_wall_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.app.sil.loop.LEAST_S", 1e-6)
    with pytest.raises(ValueError, match="by the wall clock"):
        run("magnetic", 0.2, bus={"longest_s_per_s": 1e-6})


def test_a_tick_that_does_not_return_is_failed_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.app.sil.loop.LEAST_S", 0.2)
    monkeypatch.setattr("hil.app.sil.testbed.Bench.slot", lambda *_: time.sleep(60.0))
    before, began = signal.getsignal(signal.SIGALRM), time.monotonic()
    with pytest.raises(ValueError, match=r"at most 0\.2 s by the wall clock"):
        run("magnetic", 0.2, bus={"longest_s_per_s": 1e-6})
    assert time.monotonic() - began < 10.0
    assert signal.getsignal(signal.SIGALRM) == before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_in_another_thread_it_is_failed_between_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil.app.sil.loop.LEAST_S", 1e-6)
    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="by the wall clock"):
        pool.submit(run, "magnetic", 0.2, bus={"longest_s_per_s": 1e-6}).result()


def test_led_only_by_fresh_localisation() -> None:
    """Without localisation the drive gets ready and no further."""
    trace, _ = run("coil", 0.4, {"kind": "lost", "at_s": 0.0, "duration_s": 9.0})
    assert not np.any(trace.slots[:, 1] == 0)
