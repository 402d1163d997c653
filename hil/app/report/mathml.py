"""Formulas as MathML, which browsers typeset without any script: fractions, indices, powers, roots and cases."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from html import escape
from html.entities import html5
from types import MappingProxyType
from typing import Final

from hil.app.report.words import parameter_words

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
        "pi": "pi",
        **{f"log10_{name}": name for name in ("E1", "E2", "E3", "tau1", "tau2")},
    }
)
"""Letters of the base models' parameters; parameters of effects go by their names."""
_FUNCTIONS: Final = frozenset(
    ("sin", "cos", "tan", "tanh", "exp", "log", "log1p", "sqrt", "sgn", "Sgn", "max", "min", "int", "mean", "median",
     "on", "clip", "abs", "sign", "floor", "hypot")
)  # fmt: skip
_SHORT_WORDS: Final = frozenset(
    ("in", "of", "at", "by", "to", "is", "as", "or", "it", "if", "so", "an", "be", "ms", "mm", "mN", "Pa",
     "Hz", "kg", "dB")
)  # fmt: skip
_TOKEN: Final = re.compile(
    r"\s*(?:(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z]+(?:_?[A-Za-z0-9]+)*)"
    r"|(?P<mark><=|>=|==|!=|\S))"
)
_RELATIONS: Final = MappingProxyType(
    {"=": "=", "==": "=", "<": "&lt;", ">": "&gt;", "<=": "≤", ">=": "≥", "!=": "≠", ",": ",", ";": ";", ":": ":"}
)
_CLOSING: Final = MappingProxyType({"(": ")", "[": "]", "{": "}"})
_DEEPEST: Final = 60  # nesting of a formula
_BREAK: Final = "\ue000"
"""Where a long line may go on below, before it is known what is open there."""
_WORD: Final = '<mi mathvariant="normal">'
_THIN: Final = '<mspace width="0.15em"/>'


def math_html(text: str, symbols: Collection[str] = ()) -> str:
    """One line of formulas and words as a `math` element; names in `symbols` are no words."""
    return _marked(text, symbols).replace(_BREAK, "")


def _marked(text: str, symbols: Collection[str]) -> str:
    """A `math` element in which marks stand where it may be broken."""
    try:
        inside = _Reader(text, symbols).line()
    except (IndexError, RecursionError):
        inside = f"<mtext>{escape(text)}</mtext>"
    return f"<math>{inside}</math>"


def _broken(element: str) -> str:
    """Marks where only rows are open as the end of one `math` element and the begin of the next one, between which a
    browser may go to the next line; within fractions and roots it may not.
    """
    out, opened = list[str](), list[str]()
    new = False
    for part in re.split(f"(<[^>]*>|{_BREAK})", element):
        if part == _BREAK:
            if set(opened) <= {"math", "mrow"}:
                rows = opened.count("mrow")
                out.append("</mrow>" * rows + "</math> <math>" + "<mrow>" * rows)
                new = True
            continue
        out.append('<mo form="infix" lspace="0" rspace="0.22em">' if new and part == "<mo>" else part)
        new = new and not part.startswith("<")
        if part.startswith("</"):
            opened.pop()
        elif part.startswith("<") and not part.endswith("/>"):
            opened.append(part[1:-1].split()[0])
    return "".join(out)


def equations_html(lines: Iterable[str], symbols: Collection[str] = ()) -> str:
    """All lines as one block; a line that begins with spaces continues the one before; names in `symbols` are no
    words.
    """
    rows = "".join(
        f'<div class="line{" more" if line.startswith(" ") else ""}">{_broken(_marked(line.strip(), symbols))}</div>'
        for line in lines
        if line.strip()
    )
    return f'<div class="math" tabindex="0">{rows}</div>'


def symbol_html(parameter: str) -> str:
    """The symbol of a parameter in the equations; empty where it goes by its name there."""
    symbol = _name(parameter, (parameter,))
    return "" if symbol.startswith(_WORD) else f"<math>{symbol}</math>"


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    near: bool  # no space before it


class _Reader:
    """Reads one line token by token: relations of sums of products of powers."""

    def __init__(self, text: str, symbols: Collection[str]) -> None:
        self._symbols = symbols
        found = [m for m in _TOKEN.finditer(text) if m.lastgroup]
        self._tokens = [
            _Token(str(m.lastgroup), m.group(str(m.lastgroup)), m.start() == m.start(str(m.lastgroup))) for m in found
        ]
        self._at = self._depth = 0
        self._barred = False

    def line(self) -> str:
        out = []
        while self._at < len(self._tokens):
            before = self._at
            out.append(self._relations())
            if self._at == before:
                out.append(f"<mo>{escape(self._next().text)}</mo>")
        return "".join(out)

    def _peek(self, *texts: str) -> bool:
        return self._at < len(self._tokens) and self._tokens[self._at].text in texts

    def _next(self) -> _Token:
        self._at += 1
        return self._tokens[self._at - 1]

    def _relations(self, stop: str = "") -> str:
        out = []
        while self._at < len(self._tokens) and not (stop and self._peek(stop)):
            if self._tokens[self._at].text in _RELATIONS:
                mark = _RELATIONS[self._next().text]
                out.append(f"<mo>{mark}</mo>" + (f'<mspace width="0.4em"/>{_BREAK}' if mark in ",;:" else ""))
                continue
            before = self._at
            out.append(self._sum())
            if self._at == before:
                break
        return "".join(out)

    def _sum(self) -> str:
        out = f'<mo form="prefix">{_sign(self._next().text)}</mo>' if self._peek("-", "+") else ""
        out += self._product()
        while self._peek("+", "-"):
            out += f"{_BREAK}<mo>{_sign(self._next().text)}</mo>{self._product()}"
        return out

    def _product(self) -> str:
        done, factors = list[str](), list[str]()
        while self._at < len(self._tokens):
            if self._peek("/") and factors:
                self._next()
                below = self._power()
                top = _row(_unbracketed(factors))
                factors = [f"<mfrac>{top}{_row(_unbracketed([below]))}</mfrac>"]
            elif self._peek("*"):
                self._next()
            else:
                factor = self._power()
                if not factor:
                    break
                if "<mtext" in factor[:6]:
                    done += [*factors, factor]
                    factors = []
                else:
                    factors.append(factor)
        return _joined([*done, *factors])

    def _power(self) -> str:
        base = self._atom()
        if not base:
            return ""
        primes = ""
        while self._peek("'"):
            self._next()
            primes += "′"
        if primes:
            base = f"<msup>{_row([base])}<mo>{primes}</mo></msup>"
        while self._at < len(self._tokens) and self._peek("(") and self._tokens[self._at].near:
            base = f"<mrow>{base}{self._group()}</mrow>"
        if self._peek("^"):
            self._next()
            exponent = self._signed_power()
            base = f"<msup>{_row([base])}{_row(_unbracketed([exponent]))}</msup>"
        return base

    def _signed_power(self) -> str:
        if self._peek("-", "+"):
            return f"<mrow><mo>{_sign(self._next().text)}</mo>{self._power()}</mrow>"
        return self._power()

    def _atom(self) -> str:
        if self._at >= len(self._tokens):
            return ""
        token = self._tokens[self._at]
        if token.kind == "number":
            self._next()
            return _number(token.text)
        if token.kind == "name":
            self._next()
            return self._function(token.text) or _name(token.text, self._symbols)
        if token.text in _CLOSING:
            return self._group()
        if token.text == "|" and not self._barred:
            return self._bars()
        return ""

    def _function(self, name: str) -> str:
        """`sqrt`, `abs` and `where` with what they work on; empty for all others."""
        if name not in ("sqrt", "abs", "where") or not self._peek("("):
            return ""
        self._next()
        inside = []
        while self._at < len(self._tokens) and not self._peek(")"):
            before = self._at
            inside.append(self._compared())
            if self._peek(",") or self._at == before:
                self._next()
        if self._peek(")"):
            self._next()
        if name == "sqrt":
            return f"<msqrt>{''.join(inside)}</msqrt>"
        if name == "abs":
            return f"<mrow><mo>|</mo>{''.join(inside)}<mo>|</mo></mrow>"
        condition, *ways = [*inside, "", ""][:3]
        rows = "".join(
            f"<mtr><mtd>{way}</mtd><mtd>{when}</mtd></mtr>"
            for way, when in zip(ways, (f"<mtext>where </mtext>{condition}", "<mtext>elsewhere</mtext>"), strict=False)
        )
        return f'<mrow><mo>{{</mo><mtable columnalign="left">{rows}</mtable></mrow>'

    def _compared(self) -> str:
        """One argument of a function: a sum, or two with a relation between them."""
        out = self._sum()
        while self._peek("<", ">", "<=", ">=", "==", "=", "!="):
            out += f"<mo>{_RELATIONS[self._next().text]}</mo>{self._sum()}"
        return out

    def _group(self) -> str:
        opening = self._next().text
        closing = _CLOSING[opening]
        self._depth += 1
        if self._depth > _DEEPEST:
            raise RecursionError
        barred, self._barred = self._barred, False
        inside = self._relations(closing)
        self._barred = barred
        self._depth -= 1
        if self._peek(closing):
            self._next()
        else:
            closing = ""
        return f"<mrow><mo>{opening}</mo>{inside}<mo>{closing}</mo></mrow>"

    def _bars(self) -> str:
        self._next()
        self._barred = True
        inside = self._sum()
        self._barred = False
        if self._peek("|"):
            self._next()
        return f"<mrow><mo>|</mo>{inside}<mo>|</mo></mrow>"


def _sign(text: str) -> str:
    return "−" if text == "-" else text


def _row(parts: list[str]) -> str:
    return f"<mrow>{_joined(parts)}</mrow>"


def _joined(parts: list[str]) -> str:
    """Factors side by side, with a point behind one that is a word."""
    text = "".join(part + ("<mo>·</mo>" if part.startswith(_WORD) else _THIN) for part in parts[:-1])
    return text + "".join(parts[-1:])


def _unbracketed(parts: list[str]) -> list[str]:
    """One bracketed part without its brackets: a fraction and an exponent need none."""
    if len(parts) == 1 and parts[0].startswith("<mrow><mo>(</mo>") and parts[0].endswith("<mo>)</mo></mrow>"):
        inside = parts[0].removeprefix("<mrow><mo>(</mo>").removesuffix("<mo>)</mo></mrow>")
        if inside.count("<mo>(</mo>") == inside.count("<mo>)</mo>"):
            return [inside]
    return parts


def _number(text: str) -> str:
    mantissa, mark, exponent = text.replace("E", "e").partition("e")
    if not mark:
        return f"<mn>{mantissa}</mn>"
    power = str(int(exponent)).replace("-", "−")
    return f"<mrow><mn>{mantissa}</mn><mo>·</mo><msup><mn>10</mn><mn>{power}</mn></msup></mrow>"


def _name(name: str, symbols: Collection[str]) -> str:
    text = SYMBOLS.get(name, name)
    if text in _FUNCTIONS:
        return f"<mi>{text}</mi>"
    stem, _, index = text.partition("_")
    digits = re.fullmatch(r"([A-Za-z]+?)(\d+)", stem)
    if digits and not index:
        stem, index = digits.group(1), digits.group(2)
    letter = _greek(stem)
    if index and (letter or len(stem) == 1 or (digits and len(stem) <= 2)):
        below = " ".join(_greek(part) or part for part in index.split("_"))
        return f"<msub><mi>{letter or stem}</mi><mtext>{below}</mtext></msub>"
    if letter or (not index and len(stem) <= 2 and stem not in _SHORT_WORDS):
        return f"<mi>{letter or stem}</mi>"
    if index or name in symbols:
        return f"{_WORD}{parameter_words(text)}</mi>"
    return f"<mtext>{stem}&nbsp;</mtext>" if stem in _SHORT_WORDS else f"<mtext>{stem} </mtext>"


def _greek(name: str) -> str | None:
    letter = html5.get(f"{name};", "")
    return letter if len(letter) == 1 and "Α" <= letter <= "ω" else None
