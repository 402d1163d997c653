"""The operator's words on a bench: start, stop, after a fault start again; and a dry run, in which nothing is said."""

import can
import pytest

from hil.nodes.frame_map import BOOT, ENABLED, FAULT, STANDBY
from hil.nodes.node import FAULTY, RUNNING, ControllerNode
from hil.nodes.task import Task
from tests.hil.app.sil.sil_benches import bench_of, go
from tests.hil.app.sil.sil_runs import RIGS, model_of


@pytest.mark.parametrize("kind", RIGS)
def test_start_stop_fault_and_start_again(kind: str) -> None:
    """Nothing moves before the operator's word; a stop is controlled; after a fault it takes another word and a
    reset.
    """
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
