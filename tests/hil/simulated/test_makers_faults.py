"""The same scenario through the same faults with each other maker's drive: safe in the stated time, and told."""

import random

import can
import numpy as np
import pytest

from hil.app.scenario.bus_scenario import parse_sil_scenario
from hil.app.sil.fault_outcomes import makers_limit_s
from hil.drives.makers import ACTUATORS
from hil.drives.moteus_protocol import MoteusTable
from hil.drives.odrive_protocol import OdriveTable
from tests.hil.app.sil.sil_runs import RIGS, run, scenario_of
from tests.hil.drives.maker_desk import Desk
from tests.hil.scripted_bus import ScriptedBus
from tests.hil.simulated.fault_rows import MAKERS_ROWS

AT_S, DURATION_S = 0.4, 0.3
WORDS = {
    "killed": ("",),
    "frozen": ("controller paused", "WATCHDOG", "watchdog expired", "0x8250"),
    "encoder_error": ("MISSING_ESTIMATE", "encoder fault", "0x7300", "feedback lost"),
    "over_temperature": ("OVER_TEMP", "over temperature", "0x4310"),
    "wrong_node": ("feedback lost", "silent", "WATCHDOG", "drive left"),
    "wrong_bit_rate": ("feedback lost", "silent"),
    "drive_reset": ("booted anew", "drive left operation", "feedback lost"),
    "late_solve": ("controller late",),
}
"""One of them is in the sentence."""


@pytest.mark.parametrize("drive", ACTUATORS)
@pytest.mark.parametrize(("fault", "target"), MAKERS_ROWS)
def test_every_fault_ends_in_the_safe_state(drive: str, fault: str, target: str) -> None:
    if drive == "cia402":
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    entry = {"kind": fault, "at_s": AT_S, "duration_s": DURATION_S, "target": target}
    trace, found = run("magnetic", AT_S + DURATION_S + 0.3, entry, **{drive: {}})
    t, safe, _ = trace.slots.T
    assert not safe[np.argmin(abs(t - AT_S))], "the drive must have moved before"
    scenario = scenario_of("magnetic", 1.0, entry, **{drive: {}})
    assert scenario.drive is not None
    assert not found[0].unsafe
    assert found[0].safe_after_s <= makers_limit_s(scenario.drive, scenario.loop.limits, found[0].fault)
    first = np.argmax(t - AT_S >= found[0].safe_after_s - 1e-9)
    assert safe[first:].all(), "a drive must not begin again by itself"
    assert any(words in trace.stopped_because for words in WORDS.get(fault, ("",))), trace.stopped_because
    assert trace.stopped_because or fault == "killed"


def test_only_another_makers_drive_has_another_node() -> None:
    with pytest.raises(ValueError, match=r"faults\.kind wrong_node must stand with one of \[cia402\], \[odrive\]"):
        parse_sil_scenario(
            {"scenario": {"duration_s": 1.0}, **RIGS["magnetic"], "faults": [{"kind": "wrong_node", "at_s": 0.5}]}
        )


@pytest.mark.parametrize("drive", ACTUATORS)
@pytest.mark.parametrize("fault", ["duplicate", "reorder", "replay"])
def test_what_counters_would_refuse_breaks_no_limit_without_them(drive: str, fault: str) -> None:
    """Frames of such a drive have none: it rides through, or is stopped as one that does not follow."""
    if drive == "cia402":
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    for target in ("commands", "feedback"):
        entry = {"kind": fault, "at_s": AT_S, "duration_s": DURATION_S, "target": target}
        trace, found = run("magnetic", AT_S + DURATION_S + 0.1, entry, **{drive: {}})
        assert not found[0].unsafe
        assert trace.stopped_because.partition("; then the drive does not rest")[0] in ("", "drive does not follow")


@pytest.mark.parametrize("drive", ACTUATORS)
def test_what_a_crc_would_refuse_breaks_no_limit_without_one(drive: str) -> None:
    """Once it is stopped nothing is said that would keep its watchdog from ending it."""
    if drive == "cia402":
        pytest.importorskip("canopen", reason="needs the package canopen (extra canopen)")
    entry = {"kind": "corrupt", "at_s": AT_S, "duration_s": 0.5, "target": "commands"}
    trace, found = run("magnetic", AT_S + 0.5, entry, seed=0, **{drive: {}})
    assert not found[0].unsafe
    assert trace.slots[-1, 1]
    assert trace.stopped_because


@pytest.mark.parametrize("table", [OdriveTable(), MoteusTable()])
def test_no_bytes_make_a_simulated_drive_raise(table: OdriveTable | MoteusTable) -> None:
    rng, desk = random.Random(1), Desk(table)
    told, _ = table.identifiers()
    for _ in range(20_000):
        identifier, length = rng.choice(sorted(told)), rng.choice((0, 1, 2, 3, 5, 7, 8, 12, 16, 32, 64))
        fd = isinstance(table, MoteusTable)
        data = rng.randbytes(length if fd else min(length, 8))
        desk.drive.bus = ScriptedBus(
            can.Message(arbitration_id=identifier, is_extended_id=identifier > 0x7FF, is_fd=fd, data=data)
        )
        desk.drive.listen(desk.now, 2)
