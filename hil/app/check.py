"""`capsule check`: what is wrong with records before any fit, and what they cannot show."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from rich.console import Console

from hil.app.close_loop import read_series, sizes_table
from hil.app.console import TEXT, json_text, print_json, say, summary
from hil.app.scenario.rig_file import read_deployed_rig
from hil.app.shared_options import Json, OwnEffects, Records, RigFile, option
from hil.app.write import check_targets, own_folder, write_files
from hil.report.words import grouped
from models.checks.examine import examine, stopping
from models.checks.excitation import cannot_show
from models.checks.finding import RecordFinding
from models.effects import Catalogue, effect_words
from models.identification.answer import without_size
from models.identification.identify import narrowed
from models.identification.kinds import kind_for, ready
from models.identification.record_checks import check_records
from models.identification.smallest import smallest
from models.records.record import Record, as_measured
from models.rigs.rig import Rig
from models.words.sentences import Quantity

PAGE, NUMBERS = "check.html", "check.json"
STOPPED = 1  # exit status where a finding would stop a fit


def check(
    records: Records,
    rig: RigFile,
    *,
    out: Annotated[Path | None, option("--out", "DIR")] = None,
    json_output: Json = False,
    effects: OwnEffects,
) -> int:
    """Print the findings and the effects that the records cannot show; status 1 where a finding stops a fit."""
    with own_folder(out, "--out"):
        if out is not None:
            check_targets([out / PAGE, out / NUMBERS], "--out", [*records, rig])
        belief, catalogue = read_deployed_rig(rig), Catalogue.read(effects)
        read, _ = read_series(records, (), belief, lenient=True)
        findings = examine(belief, read)
        if stopping(findings) is None:
            findings = (*_refused(belief, read), *findings)
        stops, hidden, sizes = stopping(findings) is not None, dict[str, str](), dict[str, Quantity]()
        if not stops:
            hidden = cannot_show(belief, read, catalogue.acting_on(belief.kind))
            given = catalogue.given_to(belief)
            with suppress(ValueError):  # what cannot be fitted at all shows nothing
                train = [ready(record, given) for record in read]
                kind, _ = narrowed(kind_for(given, train), given, train)
                sizes = smallest(kind, train)
                hidden |= without_size(kind, sizes)
        document = {
            "findings": [finding.to_dict() for finding in findings],
            "cannot_show": hidden,
            "smallest_detectable": {name: size.value for name, size in sizes.items()},
        }
        if out is not None:
            write_files({out / PAGE: page_html(read, findings, hidden, sizes), out / NUMBERS: json_text(document)})
    if json_output:
        print_json(document)
    else:
        show(summary(), findings, hidden)
        say(headline(findings))
        if sizes:
            summary().print(sizes_table(sizes))
        if out is not None:
            say(TEXT("check.report", path=out / PAGE))
    return STOPPED if stops else 0


def headline(findings: Sequence[RecordFinding]) -> str:
    if not findings:
        return TEXT("check.nothing")
    worst = next(one for one in ("stops", "weakens", "note") if any(f.severity == one for f in findings))
    return TEXT("check.some", count=len(findings), worst=TEXT(f"check.{worst}"))


def page_html(
    read: Sequence[Record], findings: Sequence[RecordFinding], hidden: dict[str, str], sizes: dict[str, Quantity]
) -> str:
    from hil.report.builder import page  # what draws takes half a second to load
    from hil.report.figure_traces import columns_figure, names

    return page(
        "check.html.j2",
        title=headline(findings),
        kind="named" if all(finding.severity == "note" for finding in findings) else "unknown",
        records=names(read),
        groups=[*grouped(findings)],
        hidden=hidden,
        drawn=columns_figure([replace(record, columns=as_measured(record)) for record in read]),
        sizes=[[effect_words(name), str(size)] for name, size in sizes.items()],
    )


def _refused(rig: Rig, records: Sequence[Record]) -> tuple[RecordFinding, ...]:
    try:
        check_records(records, ())
    except ValueError as error:
        at = next((record for record in records if str(error).startswith(f"{record.name}: ")), records[0])
        said = str(error).removeprefix(f"{at.name}: ")
        how, remedy = TEXT("check.refused_how"), TEXT("check.refused_remedy")
        return (RecordFinding("refused", "stops", at.source or at.name, "throughout", said, how, remedy),)
    return ()


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
