"""Plain formulas as HTML: Greek letters, indices, exponents, and numbers with powers of ten, without any script."""

from __future__ import annotations

import html
import re
from html.entities import html5
from types import MappingProxyType

_UPRIGHT = re.compile(r"sin|cos|tan|tanh|exp|log|sqrt|sgn|Sgn|max|min|int|mean|median|on|clip|abs")
_SHORT_WORDS = re.compile(r"in|of|at|by|to|is|as|or|it|if|so|an|be|ms|mm|mN|Pa|Hz|kg|dB")
_TOKEN = re.compile(
    r"(?P<number>(?<![A-Za-z_])\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<word>[A-Za-z]+(?:_[A-Za-z0-9]+)*\d*)"
    r"|(?P<power>\^)|(?P<space>\s+)|(?P<mark><=|>=|!=|.)"
)
_MARKS = MappingProxyType({"'": "′", "-": "−", "*": "·", "<=": "≤", ">=": "≥", "!=": "≠"})


def equation_html(text: str) -> str:
    """One line of formulas and words as HTML; a line that begins with spaces continues the one before."""
    out: list[str] = []
    position = 0
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            break
        position = match.end()
        if match.lastgroup == "power":
            exponent, position = _exponent(text, position)
            out.append(f"<sup>{equation_html(exponent)}</sup>")
        else:
            out.append(_piece(match))
    return "".join(out)


def equations_html(lines: tuple[str, ...]) -> str:
    """All lines as one block."""
    rows = "".join(
        f'<div class="line{" more" if line.startswith(" ") else ""}">{equation_html(line.strip())}</div>'
        for line in lines
        if line.strip()
    )
    return f'<div class="math">{rows}</div>'


def _piece(match: re.Match[str]) -> str:
    text = match.group()
    if match.lastgroup == "number":
        return _number(text)
    if match.lastgroup == "word":
        return _word(text)
    return " " if match.lastgroup == "space" else _MARKS.get(text) or html.escape(text)


def _number(text: str) -> str:
    mantissa, mark, exponent = text.replace("E", "e").partition("e")
    return f"{mantissa}·10<sup>{str(int(exponent)).replace('-', '−')}</sup>" if mark else mantissa


def _word(text: str) -> str:
    stem, _, index = text.partition("_")
    if _UPRIGHT.fullmatch(stem) and not index:
        return stem
    digits = re.fullmatch(r"([A-Za-z]+?)(\d+)", stem)
    if digits and not index:
        stem, index = digits.groups()
    if not _greek(stem) and not index and (len(stem) > 2 or _SHORT_WORDS.fullmatch(stem)):
        return f'<span class="word">{stem}</span>'
    shown = f"<i>{_greek(stem) or stem}</i>"
    return f"{shown}<sub>{' '.join(_greek(part) or part for part in index.split('_'))}</sub>" if index else shown


def _greek(name: str) -> str | None:
    letter = html5.get(f"{name};", "")
    return letter if len(letter) == 1 and "Α" <= letter <= "ω" else None


def _exponent(text: str, start: int) -> tuple[str, int]:
    """What stands after `^`: a group in brackets or braces without them, else a signed number or a word; and where it
    ends.
    """
    pairs = {"(": ")", "{": "}"}
    if start < len(text) and text[start] in pairs:
        depth = 0
        for end in range(start, len(text)):
            depth += (text[end] == text[start]) - (text[end] == pairs[text[start]])
            if depth == 0:
                return text[start + 1 : end], end + 1
    match = re.compile(r"[+-]?(?:\d+\.?\d*(?:e[+-]?\d+)?|\w+)").match(text, start)
    return (match.group(), match.end()) if match else ("", start)
