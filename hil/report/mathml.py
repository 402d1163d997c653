"""Formulas as MathML, which browsers typeset without any script: fractions, indices, powers, roots and cases."""

from collections.abc import Iterable
from html import escape
from html.entities import html5
from types import MappingProxyType
from typing import Final

from markupsafe import Markup

from hil.report.words import parameter_words
from models.formula import RELATIONS, Formula, Line, number_text, parts_of, signed

_RELATIONS: Final = MappingProxyType({"==": "=", "<=": "≤", ">=": "≥"})
_LONGEST: Final = 500  # characters of MathML in a bracket that stays on one line
_BREAK: Final = "\ue000"
"""Where a line may go on below."""
_ON: Final = '</math> <math displaystyle="true">'
_THIN: Final = '<mspace width="0.15em"/>'
_COMMA: Final = '<mo>,</mo><mspace width="0.4em"/>'
_DIGITS: Final = 4


def equations_html(lines: Iterable[Line]) -> Markup:
    rows = [Markup('<div class="line">{}</div>').format(line_html(line)) for line in lines]
    return Markup('<div class="math" tabindex="0">{}</div>').format(Markup("").join(rows))


def line_html(line: Line) -> Markup:
    """Words as they are, and each formula as `math` elements, between which a browser may go to the next line."""
    return Markup("").join(part if isinstance(part, str) else math_html(part) for part in line)


def math_html(formula: Formula) -> Markup:
    """A formula, then the equations of its parts."""
    whole, parts = parts_of(formula)
    inside = f"{_COMMA}{_BREAK}".join(map(_written, (whole, *parts)))
    inside = inside.replace(f"{_BREAK}<mo>", f'{_BREAK}<mo form="infix" lspace="0" rspace="0.22em">')
    return Markup(f'<math displaystyle="true">{inside.replace(_BREAK, _ON)}</math>')


def symbol_html(symbol: str) -> Markup:
    """A symbol by itself; empty for a word."""
    return Markup(f"<math>{_symbol(symbol)}</math>") if _letter(symbol) else Markup("")


def _written(formula: Formula) -> str:
    """The MathML of a formula, whose parts have brackets where they bind less tightly."""
    name, inputs = formula.name, formula.inputs
    if formula.number is not None:
        return _number(formula.number)
    if not inputs:
        return _symbol(name)
    if name in RELATIONS:
        return f"{_written(inputs[0])}<mo>{escape(_RELATIONS.get(name, name))}</mo>{_written(inputs[1])}"
    if name == "+":
        sign, right = signed(inputs[1])
        return f"{_written(inputs[0])}{_BREAK}<mo>{'−' if sign == '-' else sign}</mo>{_part(right, '+')}"
    if name == "neg":
        return f'<mo form="prefix">−</mo>{_part(inputs[0], "+")}'
    if name == "*":
        left, right = inputs
        point = "<mo>·</mo>" if _ends_in_word(left) or right.number is not None else _THIN
        return f"{_part(left, '+', 'neg')}{point}{_part(right, '+', 'neg')}"
    if name == "/":
        return f"<mfrac>{_row(inputs[0])}{_row(inputs[1])}</mfrac>"
    if name == "^":
        return f"<msup><mrow>{_whole(_part(inputs[0], '+', 'neg', '*', '/', '^'))}</mrow>{_row(inputs[1])}</msup>"
    if name == "sqrt":
        return f"<msqrt>{_whole(_written(inputs[0]))}</msqrt>"
    if name == "where":
        return _cases(*inputs)
    if name in ("abs", "[]"):
        opening, closing = "||" if name == "abs" else "[]"
        return _bracketed(opening, closing, inputs)
    return (f"<mi>{name}</mi>" if name.isalpha() and len(name) > 1 else _symbol(name)) + _bracketed("(", ")", inputs)


def _part(formula: Formula, *looser: str) -> str:
    """A part, in brackets where its operation is among the `looser` ones."""
    loose = formula.name in (*looser, *RELATIONS) or (formula.number is not None and formula.number < 0)
    return _bracketed("(", ")", (formula,)) if loose else _written(formula)


def _bracketed(opening: str, closing: str, parts: Iterable[Formula]) -> str:
    inside = _COMMA.join(map(_written, parts))
    tall = any(mark in inside for mark in ("<mfrac>", "<mtable", "<msqrt>"))
    before, after = (f'<mo stretchy="{str(tall).lower()}">{mark}</mo>' for mark in (opening, closing))
    if len(inside) < _LONGEST:
        return f"<mrow>{before}{_whole(inside)}{after}</mrow>"
    return f"{before}{inside}{after}".replace('stretchy="true"', 'stretchy="false"')


def _cases(condition: Formula, holds: Formula, fails: Formula) -> str:
    rows = (holds, f"<mtext>where&nbsp;</mtext>{_whole(_written(condition))}"), (fails, "<mtext>elsewhere</mtext>")
    cells = "".join(f"<mtr><mtd>{_whole(_written(one))}</mtd><mtd>{when}</mtd></mtr>" for one, when in rows)
    return f'<mrow><mo>{{</mo><mtable columnalign="left">{cells}</mtable></mrow>'


def _ends_in_word(formula: Formula) -> bool:
    while formula.name == "*":
        formula = formula.inputs[1]
    return not formula.inputs and formula.number is None and not _letter(formula.name)


def _whole(inside: str) -> str:
    return inside.replace(_BREAK, "")


def _row(formula: Formula) -> str:
    return f"<mrow>{_whole(_written(formula))}</mrow>"


def _number(number: float) -> str:
    text = number_text(number, _DIGITS)
    if text.endswith("pi"):
        return f"{'<mn>2</mn>' if ' ' in text else ''}<mi>π</mi>"
    mantissa, mark, exponent = text.replace("-", "−").partition("e")
    power = exponent.lstrip("+").replace("−0", "−").lstrip("0")
    raised = f"<mo>·</mo><msup><mn>10</mn><mn>{power}</mn></msup>"
    return f"<mrow><mn>{mantissa}</mn>{raised}</mrow>" if mark else f"<mn>{mantissa}</mn>"


def _symbol(text: str) -> str:
    """A letter with its index and primes; a name that is no letter as a word."""
    name = text.rstrip("'")
    primes = "′" * (len(text) - len(name))
    letter, index = _letter(name), name.partition("_")[2]
    written = f"<mi>{letter}</mi>" if letter else f'<mi mathvariant="normal">{escape(parameter_words(name))}</mi>'
    if letter and index:
        below = " ".join(_greek(part) or part for part in index.split("_"))
        written = f"<msub>{written}<mtext>{escape(below)}</mtext></msub>"
    return f'<mrow>{written}<mo lspace="0" rspace="0">{primes}</mo></mrow>' if primes else written


def _letter(name: str) -> str:
    """The letter, Greek or Latin, with which a symbol begins; empty for a word."""
    stem = name.rstrip("'").partition("_")[0]
    return _greek(stem) or (stem if len(stem) == 1 else "")


def _greek(name: str) -> str:
    letter = html5.get(f"{name};", "")
    return letter if len(letter) == 1 and "Α" <= letter <= "ω" else ""
