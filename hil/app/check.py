"""`capsule check`: what is wrong with records before any fit, and what they cannot show."""

from collections.abc import Sequence
from typing import Final

from rich.console import Console

from hil.app.close_loop import read_series
from hil.app.console import print_json, say, summary
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, OwnEffects, Records, RigFile
from hil.report.words import grouped
from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show
from models.checks.finding import RecordFinding
from models.effects import Catalogue
from models.words.sentences import Sentences

TEXT: Final = Sentences(__file__)
STOPPED = 1  # exit status where a finding would stop a fit


def check(records: Records, rig: RigFile, *, json_output: Json = False, effects: OwnEffects) -> int:
    """Print the findings and the effects that the records cannot show; status 1 where a finding stops a fit."""
    belief, catalogue = read_deployed_rig(rig), Catalogue.read(effects)
    read, _ = read_series(records, (), belief, lenient=True)
    findings = examine(belief, read)
    hidden = cannot_show(belief, read, catalogue.acting_on(belief.kind)) if stopping(findings) is None else {}
    if json_output:
        print_json({"findings": [finding.to_dict() for finding in findings], "cannot_show": hidden})
    else:
        show(summary(), findings, hidden)
        if not findings:
            say(TEXT("check.nothing"))
    return STOPPED if stopping(findings) else 0


def show(console: Console, findings: Sequence[RecordFinding], hidden: dict[str, str]) -> None:
    """Print the findings by kind, each with where it is and its remedy, then what the records cannot show."""
    for alike in grouped(findings):
        first = alike[0]
        console.print(f"{first.severity}: {first.id.replace('_', ' ')}", style="bold")
        lines = [f"{finding.file}, {finding.where}: {finding.sentence}" for finding in alike]
        for line in (*lines, TEXT("check.how", how=first.how), TEXT("check.remedy", remedy=first.remedy)):
            console.print(f"  {line}", soft_wrap=True)
    if hidden:
        console.print(TEXT("check.cannot_show"), style="bold")
        for why in dict.fromkeys(hidden.values()):
            names = ", ".join(name for name, reason in hidden.items() if reason == why)
            console.print(f"  {names}: {why}", soft_wrap=True)
