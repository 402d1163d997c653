"""Formulas as MathML, which browsers typeset without any script: fractions, indices, powers, roots and cases."""

import ast
import re
from collections.abc import Collection, Iterable
from html import escape
from html.entities import html5
from types import MappingProxyType
from typing import Final

from markupsafe import Markup

from hil.report.words import parameter_words

SYMBOLS: Final = MappingProxyType(
    {
        "friction_coefficient": "mu",
        "hoop_stress_factor": "c",
        "magnet_stiffness_N_per_m": "k_m",
        "spring_stiffness_N_per_m": "k",
        "spring_damping_N_s_per_m": "d",
        "recovery_time_s": "t_r",
        "mass_kg": "m",
        "body_mass_kg": "m_b",
        "inner_mass_kg": "m_i",
        "coulomb_friction_N": "F_c",
        "viscous_friction_N_s_per_m": "b",
        "offset_N": "F_0",
        "load_scale": "s_L",
        **{f"log10_{name}": name for name in ("E1", "E2", "E3", "tau1", "tau2")},
    }
)
"""Letters of the base models' parameters; parameters of effects go by their names."""
_TOKEN: Final = re.compile(
    r"(?P<space>\s*)(?:(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z]+(?:_?[A-Za-z0-9]+)*(?:'s\b|'*))"
    r"|(?P<mark>[<>=!]=|\S))"
)
_OPERATORS: Final = frozenset("+-*/^")
_INSIDE: Final = frozenset("+-*/^|()[]")
_RELATIONS: Final = MappingProxyType({"==": "=", "<=": "≤", ">=": "≥", "!=": "≠", "-": "−"})
_COMPARED: Final = MappingProxyType({ast.Lt: "<", ast.Gt: ">", ast.LtE: "≤", ast.GtE: "≥", ast.Eq: "=", ast.NotEq: "≠"})
_LONGEST: Final = 500  # characters of MathML in a bracket that stays on one line
_BREAK: Final = "\ue000"
"""Where a line may go on below."""
_THIN: Final = '<mspace width="0.15em"/>'


def math_html(text: str, symbols: Collection[str] = ()) -> Markup:
    """One line of formulas and words as `math` elements, between which a browser may go to the next line; names in
    `symbols` are no words.
    """
    inside = _line(text, symbols).removeprefix(_BREAK)
    inside = inside.replace(f"{_BREAK}<mo>", f'{_BREAK}<mo form="infix" lspace="0" rspace="0.22em">')
    return Markup(f"<math>{inside.replace(_BREAK, '</math> <math>')}</math>")


def equations_html(lines: Iterable[str], symbols: Collection[str] = ()) -> Markup:
    """All lines as one block; a line that begins with spaces continues the one before; names in `symbols` are no
    words.
    """
    rows = [
        Markup('<div class="line{}">{}</div>').format(
            " more" if line.startswith(" ") else "", math_html(line.strip(), symbols)
        )
        for line in lines
        if line.strip()
    ]
    return Markup('<div class="math" tabindex="0">{}</div>').format(Markup("").join(rows))


def symbol_html(parameter: str) -> Markup:
    """The symbol of a parameter in the equations; empty where it goes by its name there."""
    symbol = _symbol(parameter)
    return Markup(f"<math>{symbol}</math>") if symbol else Markup("")


def _line(text: str, symbols: Collection[str]) -> str:
    """Words, marks and the formulas between them."""
    out, formula, depth, barred = "", list[re.Match[str]](), 0, False
    found = [match for match in _TOKEN.finditer(text) if match.lastgroup != "space"]
    tokens = ["", *(match[0].strip() for match in found), ""]
    for match, before, token, after in zip(found, tokens, tokens[1:], tokens[2:], strict=False):
        if token == "|":
            barred = not barred
            depth += 1 if barred else -1
        depth += (token in "([") - (token in ")]")
        operand = match["name"] and (
            after == "(" or _OPERATORS & {before, after} or "_" in token or token in symbols or _symbol(token)
        )
        if depth > 0 or token in _INSIDE or match["number"] or operand:
            formula.append(match)
            continue
        mark = f"<mo>{escape(_RELATIONS.get(token, token))}</mo>" + f'<mspace width="0.4em"/>{_BREAK}' * (
            token in ",;:"
        )
        out += _formula(formula) + (f"{_THIN}<mtext>{escape(token)}&nbsp;</mtext>" if match["name"] else mark)
        formula = []
    return out + _formula(formula)


def _formula(tokens: list[re.Match[str]]) -> str:
    """Tokens without words as MathML: read as Python reads them, with signs between factors side by side; as they stand
    where they are no formula.
    """
    if not tokens:
        return ""
    source, names, before, barred = "", dict[str, str](), "", False
    for match in tokens:
        token, atom = match[0].strip(), not match["mark"]
        signed = token in "+-" and (not before or before in "([,<>")
        begins = atom or token in "([" or (token == "|" and not barred)
        called = token == "(" and not match["space"] and (before == "name" or before == ")")
        if begins and before in ("name", "number", ")") and not called:
            source += "*"
        if atom:
            key = f"n{len(names)}"
            names[key] = token
            source += key
        elif token == "|":
            source += ")" if barred else "bars("
            barred = not barred
        else:
            source += "nothing" * signed + {"^": "**", "(": "(" if called else "group("}.get(token, token)
        before = "name" if match["name"] else "number" if atom else ")" if not begins and token in ")]|" else token
    try:
        return _Writer(names).shown(ast.parse(source, mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return f"<mtext>{escape(''.join(match[0] for match in tokens))}</mtext>"


class _Writer:
    """Writes one formula, whose numbers and symbols stand in `names`."""

    def __init__(self, names: dict[str, str]) -> None:
        self._names = names

    def shown(self, node: ast.expr) -> str:
        """The MathML of a part."""
        match node:
            case ast.Name(id=name):
                return _name(self._names[name])
            case ast.UnaryOp(op=op, operand=operand):
                return f'<mo form="prefix">{"−" if isinstance(op, ast.USub) else "+"}</mo>{self.shown(operand)}'
            case ast.BinOp(left=ast.Name(id="nothing"), op=op, right=right):
                return f'<mo form="prefix">{"−" if isinstance(op, ast.Sub) else "+"}</mo>{self.shown(right)}'
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
                sign = "+" if isinstance(op, ast.Add) else "−"
                return f"{self.shown(left)}{_BREAK}<mo>{sign}</mo>{self.shown(right)}"
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                point = "<mo>·</mo>" if self._ends_in_word(left) else _THIN
                return f"{self.shown(left)}{point}{self.shown(right)}"
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return f"<mfrac>{self._bare(left)}{self._bare(right)}</mfrac>"
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return f"<msup>{_row(self.shown(left))}{self._bare(right)}</msup>"
            case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARED:
                return f"{self.shown(left)}<mo>{escape(_COMPARED[type(op)])}</mo>{self.shown(right)}"
            case ast.List(elts=parts):
                return self._bracketed("[", parts, "]")
            case ast.Call(func=ast.Name(id="group"), args=parts):
                return self._bracketed("(", parts, ")")
            case ast.Call(func=ast.Name(id="bars"), args=parts):
                return self._bracketed("|", parts, "|")
            case ast.Call(func=function, args=parts):
                return self._called(function, parts)
        raise ValueError(ast.dump(node))

    def _called(self, function: ast.expr, parts: list[ast.expr]) -> str:
        name = self._names.get(function.id, "") if isinstance(function, ast.Name) else ""
        if name == "sqrt":
            return f"<msqrt>{_whole(''.join(map(self.shown, parts)))}</msqrt>"
        if name == "abs":
            return self._bracketed("|", parts, "|")
        if name == "where" and len(parts) == 3:
            when, *ways = (_whole(self.shown(part)) for part in parts)
            cases = zip(ways, (f"<mtext>where&nbsp;</mtext>{when}", "<mtext>elsewhere</mtext>"), strict=True)
            rows = "".join(f"<mtr><mtd>{way}</mtd><mtd>{said}</mtd></mtr>" for way, said in cases)
            return f'<mrow><mo>{{</mo><mtable columnalign="left">{rows}</mtable></mrow>'
        written = f"<mi>{name}</mi>" if name.isalpha() and len(name) > 1 else self.shown(function)
        return written + self._bracketed("(", parts, ")")

    def _bracketed(self, opening: str, parts: list[ast.expr], closing: str) -> str:
        inside = '<mo>,</mo><mspace width="0.4em"/>'.join(map(self.shown, parts))
        if len(inside) < _LONGEST:
            return f"<mrow><mo>{opening}</mo>{_whole(inside)}<mo>{closing}</mo></mrow>"
        return f'<mo stretchy="false">{opening}</mo>{inside}<mo stretchy="false">{closing}</mo>'

    def _bare(self, node: ast.expr) -> str:
        """A row without its brackets: a fraction and an exponent need none."""
        match node:
            case ast.Call(func=ast.Name(id="group"), args=[inside]):
                return _row(self.shown(inside))
        return _row(self.shown(node))

    def _ends_in_word(self, node: ast.expr) -> bool:
        while isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            node = node.right
        return isinstance(node, ast.Name) and _name(self._names[node.id]).startswith("<mi mathvariant")


def _whole(inside: str) -> str:
    return inside.replace(_BREAK, "")


def _row(inside: str) -> str:
    return f"<mrow>{_whole(inside)}</mrow>"


def _name(token: str) -> str:
    """A number, or a name with its index and primes."""
    if token[0].isdigit():
        mantissa, mark, exponent = token.lower().partition("e")
        power = exponent and str(int(exponent)).replace("-", "−")
        raised = f"<mo>·</mo><msup><mn>10</mn><mn>{power}</mn></msup>"
        return f"<mrow><mn>{mantissa}</mn>{raised}</mrow>" if mark else f"<mn>{mantissa}</mn>"
    name = token.rstrip("'")
    primes = "′" * (len(token) - len(name))
    written = _symbol(name) or f'<mi mathvariant="normal">{parameter_words(name)}</mi>'
    return f"<msup><mrow>{written}</mrow><mo>{primes}</mo></msup>" if primes else written


def _symbol(text: str) -> str:
    """A letter, Greek or Latin, with its index; empty for a name that is a word."""
    text = text.rstrip("'")
    stem, _, index = SYMBOLS.get(text, text).partition("_")
    if not index and (digits := re.fullmatch(r"([A-Za-z]+?)(\d+)", stem)):
        stem, index = digits[1], digits[2]
    letter = _greek(stem) or (stem if len(stem) == 1 or stem == "iw" else "")
    if not letter or not index:
        return letter and f"<mi>{letter}</mi>"
    below = " ".join(_greek(part) or part for part in index.split("_"))
    return f"<msub><mi>{letter}</mi><mtext>{below}</mtext></msub>"


def _greek(name: str) -> str:
    letter = html5.get(f"{name};", "")
    return letter if len(letter) == 1 and "Α" <= letter <= "ω" else ""
