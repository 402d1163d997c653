"""docs/bus.md says what the DBC, the fault catalogue and the tests' limits say."""

import math
import re

from hil.app.sil.fault_outcomes import limit_of
from hil.bus.catalogue import load_catalogue
from hil.simulated.faults import KINDS, LIES, Fault
from tests.hil.app.sil.sil_runs import RIGS, scenario_of
from tests.hil.bus.markdown_tables import frames_table, load_table
from tests.hil.simulated.fault_rows import OWN_KINDS
from tests.hil.simulated.test_faults import REFUSED
from tests.places import ROOT

LINKS = KINDS["reorder"].targets[:4]
PAGE = (ROOT / "docs" / "bus.md").read_text(encoding="utf-8")


def test_frames_and_load_are_those_of_the_dbc() -> None:
    """`python -m tests.hil.bus.markdown_tables` prints them anew."""
    assert frames_table(load_catalogue()) in PAGE
    assert load_table(load_catalogue()) in PAGE


def limits(kind: str, target: str) -> str:
    """The limits in ms of a fault on each drive, as the page writes them."""
    fault = {"kind": kind, "at_s": 0.0, "target": target}
    found = (limit_of(scenario_of(rig, 1.0, fault), Fault(kind, 0.0, target=target)) for rig in RIGS)
    return " / ".join("-" if math.isinf(limit) else f"{1e3 * limit:g}" for limit in found)


def test_every_fault_stands_there_with_its_limits() -> None:
    rows = dict(re.findall(r"^\| ([a-z_]+(?: [a-z()]+)?) \| [^|]+ \| ([-\d./ ]+) \| [^|]+ \|$", PAGE, re.M))
    expected = {
        f"{kind} (any)" if kind in REFUSED and target in LINKS else f"{kind} {target}".strip(): limits(kind, target)
        for kind in OWN_KINDS
        for target in KINDS[kind].targets
    }
    assert rows == expected


def test_every_lie_stands_there_with_its_targets_and_value() -> None:
    rows = {
        kind: (targets, value)
        for kind, targets, value in re.findall(r"^\| `([a-z_]+)` \| [^|]+ \| ([a-z, ]+) \| ([^|]+) \|$", PAGE, re.M)
    }
    assert {kind: targets for kind, (targets, _) in rows.items()} == {
        k: ", ".join(lie.targets) for k, lie in LIES.items()
    }
    for kind, (_, value) in rows.items():
        own = LIES[kind].value
        assert value.endswith(f" {own:g}") or (math.isnan(own) and not re.search(r"\d", value)), kind


def test_no_measured_time_exceeds_its_limit() -> None:
    found = 0
    for row in re.findall(r"^\| [^|]+ \| [^|]+ \| ([-\d./ ]+) \| ([\d./ a-z]+) \|$", PAGE, re.M):
        allowed, measured = (cell.split(" / ") for cell in row)
        for limit, worst in zip(allowed, measured if len(measured) > 1 else 3 * measured, strict=True):
            assert (limit == "-") == worst.startswith("rode through")
            assert limit == "-" or float(worst) <= float(limit)
            found += 1
    assert found == 3 * 69
