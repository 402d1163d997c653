"""`capsule effects`: what the search can find, and whether a user's own effects keep to the rules."""

import math
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

from jinja2 import StrictUndefined, Template
from rich.table import Table

from hil.app.console import TEXT, answer, text_table
from hil.app.shared_options import Json, OwnEffects, argument, option
from hil.app.write import check_file, check_targets, write_files
from hil.report.words import column_words
from models.effects import CATALOGUE, Catalogue, effect_words
from models.effects.conformance import CHECKS
from models.effects.effect import Effect
from models.effects.equation import text_of
from models.effects.own import effects_in, own_failure
from models.files.toml import check_word, is_number
from models.identification.model import read_report
from models.identification.residual_term import FORMS, SYMBOLS, UNITS
from models.parameter import Parameter


def effects(
    *,
    action: Annotated[str, argument("check|propose")] = "list",
    file: Annotated[Path | None, argument("FILE.py|DIR")] = None,
    own: OwnEffects,
    out: Annotated[Path | None, option("--out", "FILE.py")] = None,
    json_output: Json = False,
) -> None:
    """List the catalogue, run the conformance checks on a file of effects, or write what a report proposes."""
    if (action == "propose") != (out is not None) or (action == "propose" and file is None):
        raise ValueError(f"--out FILE.py must stand with propose DIR alone; got {action}, {file or 'no folder'}")
    if file is not None and out is not None:
        propose(file, out, json_output=json_output)
        return
    check_word(action, "action", ("list", "check", "propose"))
    if (file is None) == (action == "check"):
        raise ValueError(f"a file must stand with check alone; got {file or 'none'}")
    catalogue = Catalogue.read([file] if file is not None else own)
    if action == "list":
        found = list(catalogue.candidates)
        document: dict[str, Any] = {"effects": [described(effect) for effect in found]}
    else:
        found = [origin.effect for origin in catalogue.own if file is not None and origin.file == file.name]
        checked = [{"id": effect.id, "checks": list(CHECKS), "passed": True} for effect in found]
        document = {"file": str(file), "effects": checked}
    count, checks = len(CHECKS), ", ".join(CHECKS)
    passed = (TEXT("effects.passed", effect=effect.id, count=count, checks=checks) for effect in found)
    answer(json_output, document, *([_table(found)] if action == "list" else passed))


def described(effect: type[Effect]) -> dict[str, Any]:
    return {
        "id": effect.id,
        "name": effect_words(effect.id, {effect.id: effect}),
        "summary": effect.summary,
        "equation": text_of(effect),
        "kinds": sorted(effect.kinds),
        "parameters": [
            {"name": p.name, "unit": p.unit, "value": p.value, "lower": p.lower, "upper": p.upper, "source": p.source}
            for p in effect.parameters()
        ],
        "confounders": [name for name in effect.confounders if name in CATALOGUE],
        "separated_by": effect.separated_by,
        "source": effect.source,
    }


def _table(found: Sequence[type[Effect]]) -> Table:
    heads = ("id", "what it is", "kinds of rig", "confounded with")
    table = text_table(TEXT("effects.title"), heads, heads)
    for effect in found:
        table.add_row(effect.id, effect.summary, ", ".join(sorted(effect.kinds)), ", ".join(effect.confounders))
    return table


REPORT: Final = "report.json"
_RANGE = 5.0  # times a fitted size, as far as a new fit may go
_SHARE = 3.0  # of the resistance, the most that a level may be off
_FILE: Final = Path(__file__).with_name("own_effect.py.j2")


def propose(folder: Path, out: Path, *, json_output: bool = False) -> None:
    """Write the term that a report proposes as an effect file that passed the checks. Raises ValueError."""
    report = folder / REPORT if folder.is_dir() else folder
    check_file(out, "--out", (".py",))
    check_targets([out], "--out", [report])
    text = effect_text(read_report(report), out.stem, str(report))
    with tempfile.TemporaryDirectory() as draft_folder:
        draft = Path(draft_folder) / out.name
        draft.write_text(text, encoding="utf-8")
        for origin in effects_in(draft):
            if (failure := own_failure(origin.effect, CATALOGUE)) is not None:
                raise ValueError(f"{out}: {failure}")
    write_files({out: text})
    answer(
        json_output,
        {"file": str(out), "id": out.stem, "checks": list(CHECKS)},
        TEXT("effects.proposed", out=out, effect=out.stem, count=len(CHECKS)),
        TEXT("effects.use", out=out),
    )


def effect_text(report: Mapping[str, Any], name: str, where: str) -> str:
    """The Python file of the effect `name` that a report.json proposes. Raises ValueError of one sentence."""
    if not name.isidentifier() or name != name.lower() or name in CATALOGUE:
        raise ValueError(
            f"--out must be a file named like a new effect, in lower-case letters, digits and underscores; got {name!r}"
        )
    residual = report.get("residual")
    term = residual.get("term") if isinstance(residual, Mapping) else None
    if not isinstance(term, Mapping):
        raise ValueError(
            f"{where}: report must have a term that is proposed for a residual, as one of a verdict 'unknown' may; got"
            f" verdict {report.get('verdict')!r} and none"
        )
    try:
        return _text(report, term, name)
    except (KeyError, TypeError, ValueError, StopIteration, IndexError) as error:
        raise ValueError(f"{where}: term must stand as close-loop writes it; got {type(error).__name__}") from None


def _text(report: Mapping[str, Any], term: Mapping[str, Any], name: str) -> str:
    wrong = [key for key in (*term["numbers"], *term["given"]) if not key.isidentifier()]
    if wrong:
        raise ValueError(wrong[0])  # a report may come from anywhere, and its keys become names of a program
    symbol, signal = SYMBOLS[term["variable"]]
    against = term["along"] == "-v"
    if term["sized"]:
        signal = f"np.abs({signal})"
    size = _finite(term["amplitude"]["value"])
    if against:
        size /= _finite(term["level"])
    residual = report["residual"]
    centres = next(curve["centres"] for curve in residual["curves"] if curve["variable"] == term["variable"])
    numbers = [_number(row, _finite(one["value"]), UNITS[symbol], centres) for row, one in term["numbers"].items()]
    most = max(_RANGE * abs(size), _SHARE if against else 0.0)
    offset = _finite(term["offset"])
    amplitude = Parameter("size", 0.0, "1" if against else "N", -most, most, fit=True)
    constant = Parameter("offset", offset, "1", min(offset, 0) - _RANGE, max(offset, 0) + _RANGE, fit=not against)
    arguments = [f'{n.name}=p["{n.name}"]' for n in numbers]
    arguments += [f"{key}={_written(value)}" for key, value in term["given"].items()]
    form = str(term["form"])
    if form not in (*(f.name for f in FORMS), "knots"):
        raise ValueError(form)
    look: dict[str, Any] = {"trim_blocks": True, "keep_trailing_newline": True}
    text: str = Template(_FILE.read_text(encoding="utf-8"), undefined=StrictUndefined, **look).render(
        name="".join(part.capitalize() for part in name.split("_")),
        id=name,
        kind=repr(str(report["kind"])),
        words=column_words(term["variable"])[0],
        text=repr(str(term["text"])),
        records=tuple(map(str, residual["records"])),
        size=size,
        parameters=(amplitude, constant, *numbers),
        against=against,
        signal=signal,
        form=form,
        arguments="".join(f", {one}" for one in arguments),
    )
    return text


def _number(name: str, value: float, unit: str, centres: Sequence[float]) -> Parameter:
    if name == "middle":
        span = max(centres) - min(centres)
        lower, upper = min(value, *centres) - span, max(value, *centres) + span
    elif name == "phase":
        unit, lower, upper = "1", value - math.pi, value + math.pi
    elif name == "slope":
        unit, lower, upper = "1", _RANGE * min(value, 0.0) - 1, _RANGE * max(value, 0.0) + 1
    else:
        lower, upper = value / _RANGE, _RANGE * value
    return Parameter(name, value, unit, lower, upper, fit=True)


def _finite(value: object) -> float:
    if not is_number(value):
        raise ValueError(value)
    return float(value)  # type: ignore[arg-type]


def _written(value: Any) -> str:
    if isinstance(value, list):
        return "(" + ", ".join(f"{_finite(v):.6g}" for v in value) + ")"
    return f"{_finite(value):.6g}"
