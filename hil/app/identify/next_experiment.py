"""The files of the next experiment: the motion as a CSV that a rig is driven by, and as a reference that `--reference`
reads.
"""

from __future__ import annotations

from typing import Any

from models.files.toml import toml_text
from models.identification.finding import NEXT_CSV, Proposal

_MM = 1e3  # in a metre


def next_toml(proposal: Proposal, kind: str) -> str:
    """The reference, places counted from where it starts, and what it is expected to separate or to show."""
    tables: dict[str, Any] = {
        "experiment": {"kind": kind, "column": proposal.column, "duration_s": round(float(proposal.times_s[-1]), 4)},
        "reference": {
            "kind": "waypoints",
            "times_s": [round(float(t), 4) for t in proposal.times_s[1:]],
            "positions_mm": [round(_MM * float(x - proposal.places_m[0]), 4) for x in proposal.places_m[1:]],
        },
    }
    if proposal.separations:
        tables["separates"] = {
            f"{one.effect}_from_{one.rival}": {
                "standard_deviations": round(one.standard_deviations, 2),
                "best_record_so_far": one.best_record,
                "standard_deviations_so_far": round(one.so_far, 2),
            }
            for one in proposal.separations
        }
    if proposal.shows:
        tables["shows"] = {"effects": list(proposal.shows)}
    head = (
        f"# The next experiment, proposed by close-loop; {NEXT_CSV} holds the same motion for a rig driven from a file."
        "\n# capsule track, sil and run drive it with --reference.\n"
    )
    return head + toml_text(tables)
