"""Two faults at once that a moteus's frames without counter, CRC and handshake do not show by themselves: safe all the
same, by what its replies tell back of commands and by a can.prefix that it loses as it boots.
"""

import pytest

from tests.hil.app.sil.sil_runs import run

AT_S, DURATION_S = 0.4, 0.2
PAIRS = {
    "all late, drive boots": (("delay", "all"), ("drive_reset", "")),
    "commands corrupt, controller late": (("corrupt", "commands"), ("late_solve", "")),
    "commands corrupt, no feedback": (("corrupt", "commands"), ("drop", "feedback")),
}


@pytest.mark.parametrize("seed", range(1, 4))
@pytest.mark.parametrize("pair", PAIRS)
def test_two_faults_at_once_are_safe(pair: str, seed: int) -> None:
    at_s = AT_S + 5e-4 * seed
    faults = [{"kind": kind, "at_s": at_s, "duration_s": DURATION_S, "target": target} for kind, target in PAIRS[pair]]
    trace, found = run("magnetic", at_s + DURATION_S + 0.1, *faults, seed=seed, moteus={})
    t, safe, _ = trace.slots.T
    if "corrupt" not in pair:  # a corrupt command without CRC may stop the drive, and the next one lead it on
        assert not found[0].unsafe
    assert found[0].safe_after_s < 0.07
    assert safe[t > at_s + 0.07].all()
    assert found[0].unsafe <= (not safe[(t > at_s + found[0].safe_after_s) & (t <= at_s + 0.07)].all())
    assert trace.slots[-1, 1]
    assert trace.stopped_because
