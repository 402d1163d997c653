"""What the records show of themselves, at the head of a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from hil.app.quantities import number
from hil.app.report.words import effect_words, listed, tidy
from models.checks.finding import RecordFinding
from models.identification.finding import Finding
from models.identification.verdict import WORSE

SEVERITIES = {"stops": "stops a fit", "weakens": "weakens the verdict", "note": "note"}


def grouped(findings: Sequence[RecordFinding]) -> Iterator[list[RecordFinding]]:
    """Findings of one id and severity together, in their order."""
    for name, severity in dict.fromkeys((finding.id, finding.severity) for finding in findings):
        yield [finding for finding in findings if (finding.id, finding.severity) == (name, severity)]


def findings_html(finding: Finding) -> str:
    """Findings as cards, each with its records, how it was told and the remedy; then what the records cannot show."""
    cards = "".join(map(_card, grouped(finding.findings)))
    hidden = "".join(
        f"<li>{escape(listed(effect_words(name) for name, said in finding.cannot_show.items() if said == why))}:"
        f" {escape(why)}</li>"
        for why in dict.fromkeys(finding.cannot_show.values())
    )
    return cards + (f"<h3>These records cannot show</h3><ul>{hidden}</ul>" if hidden else "")


def warning_html(finding: Finding) -> str:
    """What keeps the report from a verdict, or checks that fail: a warning on top; empty where there is none."""
    failed = [
        f"{check.name}: {number(check.value, 3)}, at most {number(check.limit, 3)} allowed ({check.meaning})"
        for check in finding.checks
        if not check.ok
    ]
    said = [*finding.reasons] or failed
    said += [found.sentence for found in finding.findings if found.id == WORSE and found.sentence not in said]
    if not said:
        return ""
    no_verdict = "The records allow no verdict" if finding.verdict == "unknown" else "A stage of the model is worse"
    some = f"{len(failed)} of {len(finding.checks)} checks fail" if failed else no_verdict
    rows = "".join(f"<li>{escape(tidy(reason))}</li>" for reason in said)
    return f'<div class="warning" role="note"><p>{some}: do not rely on this model yet.</p><ul>{rows}</ul></div>'


def _card(alike: Sequence[RecordFinding]) -> str:
    first = alike[0]
    places = "".join(f"<li><b>{escape(f.file)}</b>, {escape(f.where)}: {escape(tidy(f.sentence))}</li>" for f in alike)
    return (
        f'<div class="card {first.severity}"><h3>{escape(first.id.replace("_", " "))}'
        f" <small>{SEVERITIES[first.severity]}</small></h3><ul>{places}</ul>"
        f"<p>Told by: {escape(first.how)}.</p><p>Remedy: <code>{escape(first.remedy)}</code></p></div>"
    )
