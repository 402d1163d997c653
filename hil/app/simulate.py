"""`capsule simulate`: the plant alone, from a scenario file to a record."""

from pathlib import Path
from typing import Annotated

from hil.app.console import answer, output_to_notes
from hil.app.shared_options import Json, argument, option
from hil.app.write import check_targets
from plant.experiments.scenario import load_scenario, record_scenario, write_record


def simulate(
    scenario: Annotated[Path, argument("SCENARIO.toml", reads="scenario")],
    out: Annotated[Path, option("--out", "RECORD.csv")],
    json_output: Json = False,
) -> None:
    with output_to_notes():
        write_simulated(scenario, out)
    answer(json_output, {"scenario": str(scenario), "record": str(out)}, f"record: {out}")


def write_simulated(scenario: Path, out: Path) -> None:
    """Write the record of a scenario to `out`, complete or not at all. Raises ValueError of one sentence."""
    if not (out.name.endswith(".csv") or out.name.endswith(".csv.gz")):
        raise ValueError(f"--out must end in .csv or .csv.gz; got {out.name!r}")
    if not out.parent.is_dir():
        raise ValueError(f"--out must lie in a folder that exists; got {str(out.parent)!r}")
    check_targets([out], "--out", [scenario])
    write_record(out, record_scenario(load_scenario(scenario)))
