"""The row of each example on the demo's page: hidden, found, the size of both, and the errors before and after."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from hil.app.demo.example import TEXT, End, Example, ExampleResult, Learned, title_of
from hil.report.numbers import parameters
from hil.report.words import column_words, error_cells, parameter_words, tested_part
from models.effects import CATALOGUE, effect_words
from models.identification.finding import STAGES
from models.words.quantities import DASH, quantity, unit_words
from models.words.sentences import listed

_SHOWN: Final = 2  # numbers of an effect: its amplitude and, of the plant's and the model's, one that both have


def story_row(example: Example, one: End) -> list[str]:
    """Title, hidden, found, size of both, and error of the prediction and of the tracking, before and after."""
    found = one.learnt if isinstance(one, Learned) else [effect.id for effect in one.finding.effects]
    sizes = _learnt(one) if isinstance(one, Learned) else _found(one)
    hidden = listed(map(effect_words, one.hidden)) or TEXT("row.measured")
    title = title_of(example)
    row = [title[:1].upper() + title[1:], hidden, listed(map(effect_words, found)) or TEXT("row.nothing")]
    return [*row, _sizes(one.truth) or DASH, sizes or DASH, _prediction(one), _tracking(one)]


def _sizes(effects: Mapping[str, Mapping[str, Any]]) -> str:
    return ", ".join(
        f"{parameter_words(key)} {quantity(value, column_words(key)[1])}"
        for numbers in effects.values()
        for key, value in list(numbers.items())[:_SHOWN]
    )


def _shown(effect: str, names: Iterable[str], truth: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """The effect's amplitude, and what the plant's effect of this name has too among the numbers that are shown."""
    first, *others = names
    return [first, *(name for name in others if name in list(truth.get(effect, {}))[:_SHOWN])]


def _found(one: ExampleResult) -> str:
    said = []
    for effect in one.finding.effects:
        shown = _shown(effect.id, effect.parameters, one.truth)
        for row in parameters({name: effect.parameters[name] for name in shown})["rows"]:
            unit = unit_words(row["unit"])
            interval = f" ({row['low']} … {row['high']})" if row["identifiable"] else ""
            said.append(f"{parameter_words(row['name'])} {row['value']}{interval} {unit}".rstrip())
    return ", ".join(said)


def _learnt(one: Learned) -> str:
    units = {name: {p.name: p.unit for p in CATALOGUE[name].parameters()} for name in one.learnt}
    return ", ".join(
        f"{parameter_words(key)} {quantity(numbers[key], units[name][key])}"
        for name, numbers in one.learnt.items()
        for key in _shown(name, numbers, one.truth)
    )


def _change(before: str, after: str) -> str:
    return TEXT("row.change", before=before, after=after)


def _prediction(one: End) -> str:
    if isinstance(one, Learned):
        return DASH
    cells = dict(zip(STAGES, error_cells(one.finding, tested_part(one.finding)), strict=False))
    return _change(cells[STAGES[0]], cells["augmented" if one.finding.effects else "calibrated"])


def _tracking(one: End) -> str:
    if isinstance(one, Learned):
        *earlier, after = (part["rms_error_m"] for part in one.numbers["parts"] if part["rms_error_m"] is not None)
        before = (earlier or [after])[-1]
    elif one.missions:
        runs = list(one.missions.values())
        before, after = (run.numbers["tracking_rmse_m"] for run in (runs[0], runs[-1]))
    else:
        return DASH
    return _change(quantity(before, "m"), quantity(after, "m"))
