"""The demo's report: one self-contained page with every loop from residual and effect to prediction and tracking,
before and after.
"""

from collections.abc import Sequence
from html import escape
from typing import Final

from hil.app.demo.figures import improvement_figure, left_over_figure, mission_figure
from hil.app.demo.next_record import BEFORE
from hil.app.demo.story import Learned, Mission, Story, Told
from hil.app.identify.close_loop import MODEL, REPORT
from hil.app.quantities import DASH, quantity, scale, unit_words
from hil.app.quantities import told as numbers_told
from hil.app.report import headline
from hil.app.report.document import document, heading, mixed_table, table
from hil.app.report.figure_traces import motion_figure, trace_figure
from hil.app.report.panels import panels
from hil.app.report.tables import separations_table
from hil.app.report.theme import figure_html
from hil.app.report.words import classes_words, column_words, effect_words, error_story, listed, parameter_words
from hil.app.sil.story import PAGE as LEARNED
from hil.app.sil.story import error_figure, parts_table
from models.identification.finding import NEXT_TOML, STAGES, Finding

POINTS: Final = 4000  # of a line
_LINES: Final = (
    "<p>Dots are samples. The solid line is their local mean while the capsule moves forward, the dotted one while it"
    " moves backward; orange is the model before, teal the one after.</p>"
)
Line = tuple[Story, Told]


def demo_html(lines: Sequence[Line], seconds: float, learned: Sequence[tuple[Story, Learned]] = ()) -> str:
    """The page for all stories, driven ones first and in full, then those that `learned` while they ran."""
    loops = [line for line in lines if line[1].missions]
    poor = [(story, told, told.before) for story, told in lines if told.before is not None]
    compared = _figure(improvement_figure(loops), "improvement") if loops else ""
    sections = [("numbers", "Before and after", _table(lines) + compared)]
    parts = [(story, _loop(story, told)) for story, told in loops]
    parts += [(story, _proposed(story, told, before)) for story, told, before in poor]
    parts += [(story, _learned(story, one)) for story, one in learned]
    sections += [(story.name, _capital(story.title), part) for story, part in parts]
    title = "Drive, record, find what the model lacks, drive again"
    story = " ".join(
        [
            *(_sentence(story, told) for story, told in loops),
            *(_told_later(story, told, before) for story, told, before in poor),
            *(f"{_capital(story.title)}: {told.caution}" for story, told in lines if told.caution),
            *(f"{_capital(story.title)}: {one.sentence}." for story, one in learned),
        ]
    )
    head = heading(f"Capsule demo · {len(lines) + len(learned)} stories · {seconds:.0f} s", title, story, "named")
    return document(title, head, sections)


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _sentence(story: Story, told: Told) -> str:
    """What a loop came to, in a sentence."""
    first, last = (quantity(told.missions[stage].numbers["tracking_rmse_m"], "m") for stage in (STAGES[0], _last(told)))
    names = listed(effect_words(effect.id) for effect in told.finding.effects) or "no effect"
    again = f"tracking error {first} before, {last} with the {_last(told)} model"
    again = again if _last(told) != STAGES[0] else "no model passed"
    return f"{story.name.capitalize()} rig: kept from everyone was {_kept(told)}; named was {names}; {again}."


def _told_later(story: Story, told: Told, before: Finding) -> str:
    """What poor records came to and what the proposed one added, in a sentence."""
    return (
        f"{_capital(story.title)}: kept from everyone was {_kept(told)}; the verdict was “{_said(before)}” on the first"
        f" records, “{_said(told.finding)}” with the proposed one."
    )


def _said(finding: Finding) -> str:
    classes = classes_words(finding)
    return f"{finding.verdict}: {classes}" if classes else finding.verdict


def _last(told: Told) -> str:
    """The last stage that the gate let in."""
    return [stage for stage in STAGES if stage in told.missions][-1]


def _table(lines: Sequence[Line]) -> str:
    heads = ("Story", "Error of", *STAGES, "noise floor", "Verdict", "Report")
    rows = []
    for story, told in lines:
        link = f'<a href="{story.name}/{REPORT}">report</a>'
        rows.append([escape(story.title), *told.errors(), escape(headline(told.finding)), link])
        if told.missions:
            again = "&nbsp;&nbsp;the same run driven again"
            rows.append([again, "tracking, rms", *told.tracked(), "", _gate(told), ""])
    return mixed_table([(head, place in (0, 1, 6, 7)) for place, head in enumerate(heads)], rows)


def _gate(told: Told) -> str:
    return "; ".join(
        f'gate, {stage}: <span class="{"pass" if verdict.passed else "fail"}">{escape(verdict.sentence)}</span>'
        for stage, verdict in told.gate.items()
    )


def _loop(story: Story, told: Told) -> str:
    """A driven story from what was hidden to what came of it."""
    finding, key = told.finding, story.name
    stages = ", ".join(f"{_tracked(mission)} with the {stage} model" for stage, mission in told.missions.items())
    parts = [
        (
            f"<p>Kept from controller, model and search: <b>{escape(_kept(told))}</b>. The rig was driven over the bus"
            " under the nominal model; close-loop read the logs of those runs. The mission below was never among"
            " them.</p>"
        ),
        f"<h3>Residual</h3>{_LINES}{_figure(left_over_figure(finding), f'{key}-residual')}",
        f"<h3>Effect: the truth beside what was found</h3><p>{escape(headline(finding))}</p>{_truth_table(told)}",
        _held_out(finding, key),
        f"<h3>Acceptance test</h3><p>{_gate(told)}</p>",
        (
            "<h3>The same run again</h3><p>Rms (largest) tracking error of the true path, under one seed:"
            f" {escape(stages)}. The thick grey line is where the capsule was to go.</p>"
        ),
        _figure(mission_figure(told.missions), f"{key}-mission"),
        (
            f'<p><a href="{key}/{REPORT}">Report of close-loop</a>, <a href="{key}/{MODEL}">model</a>; beside them the'
            " scenario and log of every run.</p>"
        ),
    ]
    return "".join(parts)


def _proposed(story: Story, told: Told, before: Finding) -> str:
    """From records that cannot tell what was hidden, over the record that was proposed, to what is told with it."""
    finding, proposal, key = told.finding, before.proposal, story.name
    motion = (
        f"{_figure(motion_figure(proposal), f'{key}-motion')}{separations_table(proposal)}"
        if proposal is not None
        else "<p>Nothing was proposed.</p>"
    )
    return "".join(
        [
            f"<p>Kept from model and search: <b>{escape(_kept(told))}</b>.</p>",
            f"<h3>The first records</h3><p>{escape(headline(before))}"
            f' <a href="{key}/{BEFORE}/{REPORT}">Their report</a>.</p>',
            f"<h3>The record that close-loop proposes</h3>{motion}",
            f"<h3>With that record</h3><p>{escape(headline(finding))}</p>{_truth_table(told)}",
            _held_out(finding, key),
            f'<p><a href="{key}/{REPORT}">Report of close-loop</a>, <a href="{key}/{MODEL}">model</a>; beside them the'
            f" scenario and record of every run, and the proposal in <code>{key}/{BEFORE}/{NEXT_TOML}</code>.</p>",
        ]
    )


def _learned(story: Story, one: Learned) -> str:
    """A run that learned: error over time with its instants, and the error between them."""
    return "".join(
        [
            f"<p>Kept from controller, model and search: <b>{escape(_kept(one))}</b>, which began on the way."
            f" What came of it: {escape(one.sentence)}.</p>",
            _figure(error_figure(one.numbers), f"{story.name}-error"),
            parts_table(one.numbers),
            f'<p><a href="{story.name}/{LEARNED}">The whole story</a>.</p>',
        ]
    )


def _held_out(finding: Finding, key: str) -> str:
    """The held-out error in words and the record in a picture."""
    held = next((trace for trace in finding.traces if trace.role == "holdout"), finding.traces[0])
    return (
        f"<h3>Prediction, on a run that no fit has seen</h3><p>{escape(error_story(finding))}</p>"
        f"{_figure(trace_figure(panels(finding, held)[0], POINTS), f'{key}-held-out')}"
    )


def _kept(told: Told | Learned) -> str:
    """What the simulated rig kept to itself."""
    return listed(map(effect_words, told.hidden)) or "nothing"


def _truth_table(told: Told) -> str:
    """What the simulated rig kept to itself beside what was found, a row a number."""
    rows = []
    for name, numbers in told.truth.items():
        for key, value in numbers.items():
            truth = quantity(value, column_words(key)[1]) if isinstance(value, int | float) else escape(str(value))
            rows.append([escape(effect_words(name)), escape(parameter_words(key)), truth, DASH, DASH])
    place = {(row[0], row[1]): row for row in rows}
    for effect in told.finding.effects:
        for key, estimate in effect.parameters.items():
            words, named = effect_words(effect.id), parameter_words(key)
            row = place.get((words, named))
            if row is None:
                rows.append(row := [escape(words), escape(named), DASH, DASH, DASH])
            factor, unit = scale([estimate.value, *estimate.ci95], estimate.unit)
            low, high = (factor * end for end in estimate.ci95)
            found = numbers_told(factor * estimate.value, (low, high))
            row[3] = f"{found.value} {unit_words(unit)}".rstrip()
            row[4] = f"{found.low} … {found.high} {unit_words(unit)}".rstrip() if estimate.told else "not told"
    note = (
        "<p>The rig's effect has another form than the model's, so lengths and places compare one to one, heights only"
        " roughly.</p>"
    )
    return table(["effect", "parameter", "truth", "found", "95 % interval"], rows, left=2) + note


def _tracked(mission: Mission) -> str:
    rms, largest = (mission.numbers[key] for key in ("tracking_rmse_m", "tracking_max_m"))
    stopped = mission.numbers["stopped_because"]
    return f"{quantity(rms, 'm')} ({quantity(largest, 'm')})" + (f", stopped ({stopped})," if stopped else "")


def _figure(figure: object, name: str) -> str:
    return figure_html(figure, name) if figure is not None else ""
