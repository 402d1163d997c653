"""Formulas as trees: a symbol that remembers what is done with it, how that is written, and its value.

A law that is written once with NumPy functions is called with `Formula` symbols in place of numbers; what it returns is
the law as a tree. Texts and pages write the tree; nothing reads a formula's text again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

_COMPARED, _SUM, _PRODUCT, _POWER, _ATOM = range(5)
_WRITTEN: Final = MappingProxyType({"absolute": "abs", "sign": "sgn", "maximum": "max", "minimum": "min"})
"""Names of NumPy's functions in a formula, where they differ."""


@dataclass(frozen=True, eq=False)
class Formula(NDArrayOperatorsMixin):
    """A formula: a symbol, a number, or an operation on formulas. `name` is that of the symbol, of the operator
    (`+ - * / ^`, a comparison, `neg`), of an equation (`=`), a list (`[]`) or of the function; `inputs` are what it
    works on. Of a part that is `named`, the inputs are its symbol and what it stands for; of one that is `shown` in
    another form, what is computed and what is written.
    """

    name: str
    inputs: tuple[Formula, ...] = ()
    number: float | None = None

    @classmethod
    def of(cls, value: Any) -> Formula:
        """`value` as a formula."""
        return value if isinstance(value, Formula) else cls("", number=float(value))

    def names(self) -> set[str]:
        """The names of all symbols and functions in it."""
        return {self.name}.union(*(one.names() for one in self.inputs))

    def __bool__(self) -> bool:
        raise TypeError("a formula has no truth value: use np.where instead of if")

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        """What NumPy's elementwise functions, and with them all operators, do with a formula."""
        name = ufunc.__name__
        if method != "__call__" or options.keys() - {"out"}:
            return NotImplemented
        if name in _OPERATIONS:
            return _OPERATIONS[name](*(Formula.of(value) for value in inputs))
        return called(_WRITTEN.get(name, name), *inputs)

    def __array_function__(self, function: Any, types: Any, inputs: Any, options: Any) -> Any:
        """What NumPy's other functions do with a formula: `where` and `clip`."""
        if function not in (np.where, np.clip) or options:
            return NotImplemented
        return called(function.__name__, *inputs)


def called(name: str, *inputs: Any) -> Formula:
    """The function `name` of `inputs`."""
    return Formula(name, tuple(Formula.of(value) for value in inputs))


def _numbers(*formulas: Formula) -> list[float] | None:
    found = [formula.number for formula in formulas if formula.number is not None]
    return found if len(found) == len(formulas) else None


def _negative(a: Formula) -> Formula:
    if a.number is not None:
        return Formula.of(-a.number)
    return a.inputs[0] if a.name == "neg" else Formula("neg", (a,))


def _sum(a: Formula, b: Formula) -> Formula:
    if (numbers := _numbers(a, b)) is not None:
        return Formula.of(sum(numbers))
    if a.number == 0 or b.number == 0:
        return b if a.number == 0 else a
    return Formula("+", (a, b))


def _product(a: Formula, b: Formula) -> Formula:
    if (numbers := _numbers(a, b)) is not None:
        return Formula.of(numbers[0] * numbers[1])
    if a.number == 0 or b.number == 0:
        return Formula.of(0.0)
    if a.number == 1 or b.number == 1:
        return b if a.number == 1 else a
    if a is b:
        return _power(a, Formula.of(2.0))
    for one, other in ((a, b), (b, a)):
        if one.name == "neg" or (one.number or 0) < 0:
            return _negative(_product(_negative(one), other))
    if "/" in (a.name, b.name):
        (top, below), other = (a.inputs, b) if a.name == "/" else (b.inputs, a)
        return _quotient(_product(*((top, other) if a.name == "/" else (other, top))), below)
    if b.number is not None:
        a, b = b, a
    if b.name == "*" and (factor := b.inputs[0]).number is not None:
        return _product(_product(factor, a), b.inputs[1])
    return Formula("*", (a, b))


def _quotient(a: Formula, b: Formula) -> Formula:
    if (numbers := _numbers(a, b)) is not None:
        return Formula.of(numbers[0] / numbers[1])
    if a.number == 0:
        return a
    if a.name == "neg" or (a.number or 0) < 0:
        return _negative(_quotient(_negative(a), b))
    if a.name == "/":
        return _quotient(a.inputs[0], _product(a.inputs[1], b))
    if b.name == "/":
        return _quotient(_product(a, b.inputs[1]), b.inputs[0])
    return a if b.number == 1 else Formula("/", (a, b))


def _power(a: Formula, b: Formula) -> Formula:
    if (numbers := _numbers(a, b)) is not None:
        return Formula.of(numbers[0] ** numbers[1])
    if a.number == 10 and b.name == "log10":
        return b.inputs[0]
    return a if b.number == 1 else Formula("^", (a, b))


_COMPARISONS: Final = MappingProxyType(
    {"less": "<", "less_equal": "<=", "greater": ">", "greater_equal": ">=", "equal": "=="}
)
RELATIONS: Final = frozenset({"=", *_COMPARISONS.values()})
_OPERATIONS: Final[Mapping[str, Callable[..., Formula]]] = {
    "add": _sum,
    "subtract": lambda a, b: _sum(a, _negative(b)),
    "multiply": _product,
    "divide": _quotient,
    "power": _power,
    "float_power": _power,
    "square": lambda a: _power(a, Formula.of(2.0)),
    "negative": _negative,
    "positive": lambda a: a,
    **{name: partial(called, sign) for name, sign in _COMPARISONS.items()},
}
Line = Sequence[str | Formula]
"""Words and formulas, as they follow each other in a line."""


def symbols(names: str) -> tuple[Formula, ...]:
    """A symbol for each of the `names` between blanks."""
    return tuple(Formula(name) for name in names.split())


def equal(left: Any, right: Any) -> Formula:
    """The equation `left = right`."""
    return called("=", left, right)


def named(symbol: str, value: Any, beside: Any = None) -> Any:
    """`value`; in a formula it goes by `symbol`, which is explained after it: a number where `beside` is a formula."""
    return (
        called("named", Formula(symbol), value) if isinstance(value if beside is None else beside, Formula) else value
    )


def shown_as(value: Any, form: Callable[[], Any]) -> Any:
    """`value`; a formula is computed as it is and written as the textbook's `form`."""
    return called("shown", value, form()) if isinstance(value, Formula) else value


def at_least(value: Any, least: float) -> Any:
    """`value`, or `least` where it is less: a bound that keeps numbers finite and is not written in a formula."""
    return shown_as(np.maximum(value, least), lambda: value)


def polynomial(x: Any, *coefficients: Any) -> Any:
    """`c_0 + c_1 x + c_2 x^2 ...` by Horner's rule."""
    if isinstance(x, Formula):
        return sum((c * x**k for k, c in enumerate(coefficients[1:], start=1)), coefficients[0])
    *lower, value = coefficients
    for c in reversed(lower):
        value = c + value * x
    return value


def interpolated(x: Any, places: Sequence[Any], values: Sequence[Any]) -> Formula:
    """The formula of straight lines over `x` between `values` at the ascending `places`."""
    return called("interp", x, called("[]", *places), called("[]", *values))


def parts_of(formula: Formula) -> tuple[Formula, list[Formula]]:
    """The formula as it is written, and equations of its parts that have a name or stand in it more than once."""
    uses, done, parts = Counter[int](), dict[int, Formula](), dict[str, Formula]()

    def count(part: Formula) -> None:
        uses[id(part)] += 1
        if uses[id(part)] == 1:
            for one in part.inputs[part.name == "shown" :]:
                count(one)

    def cut(part: Formula) -> Formula:
        if id(part) in done:
            return done[id(part)]
        if part.name == "shown":
            whole = cut(part.inputs[1])
        elif part.name == "named":
            whole = part.inputs[0]
            parts[whole.name] = equal(whole, cut(part.inputs[1]))
        else:
            whole = Formula(part.name, tuple(map(cut, part.inputs)), part.number)
            if uses[id(part)] > 1 and any(one.inputs for one in whole.inputs):
                inside, whole = whole, Formula(f"q_{len(parts) + 1}")
                parts[whole.name] = equal(whole, inside)
        done[id(part)] = whole
        return whole

    count(formula)
    return cut(formula), list(parts.values())


def line_text(line: Line) -> str:
    """A line as text."""
    return "".join(part if isinstance(part, str) else written(part) for part in line)


def written(formula: Formula, digits: int = 4) -> str:
    """The formula as text with so many significant digits, then the equations of its parts."""
    whole, parts = parts_of(formula)
    return ", ".join(_text(one, _COMPARED, digits) for one in (whole, *parts))


def number_text(number: float, digits: int) -> str:
    """A number in a formula."""
    return "pi" if number == math.pi else "2 pi" if number == math.tau else f"{number:.{digits}g}"


def signed(term: Formula) -> tuple[str, Formula]:
    """The sign with which a term of a sum is written, and what follows it."""
    return ("-", _negative(term)) if term.name == "neg" or (term.number or 0) < 0 else ("+", term)


def _text(formula: Formula, binds: int, digits: int) -> str:
    """The text, in brackets where it binds less tightly than `binds`."""

    def inside(part: Formula, tightly: int = _COMPARED) -> str:
        return _text(part, tightly, digits)

    name, inputs, own = formula.name, formula.inputs, _ATOM
    if formula.number is not None:
        text = number_text(formula.number, digits)
        own = _SUM if formula.number < 0 else _PRODUCT if " " in text else _ATOM
    elif not inputs:
        text = name
    elif name in RELATIONS:
        text, own = f"{inside(inputs[0], _SUM)} {name} {inside(inputs[1], _SUM)}", _COMPARED
    elif name == "+":
        sign, right = signed(inputs[1])
        text, own = f"{inside(inputs[0], _SUM)} {sign} {inside(right, _PRODUCT)}", _SUM
    elif name == "neg":
        text, own = f"-{inside(inputs[0], _PRODUCT)}", _SUM
    elif name == "*":
        text, own = f"{inside(inputs[0], _PRODUCT)} {inside(inputs[1], _PRODUCT)}", _PRODUCT
    elif name == "/":
        text, own = f"{inside(inputs[0], _PRODUCT)}/{inside(inputs[1], _POWER)}", _PRODUCT
    elif name == "^":
        text, own = f"{inside(inputs[0], _ATOM)}^{inside(inputs[1], _ATOM)}", _POWER
    elif name == "abs" and "|" not in (bare := inside(inputs[0])):
        text = f"|{bare}|"
    else:
        opening, closing = ("[", "]") if name == "[]" else (f"{name}(", ")")
        text = opening + ", ".join(map(inside, inputs)) + closing
    return text if own >= binds else f"({text})"


_COMPUTED: Final[Mapping[str, Callable[..., Any]]] = {
    **{"+": np.add, "*": np.multiply, "/": np.divide, "^": np.power, "neg": np.negative},
    **{sign: getattr(np, name) for name, sign in _COMPARISONS.items()},
    "[]": lambda *values: np.array(values),
    **{written: getattr(np, name) for name, written in _WRITTEN.items()},
}


def value_of(formula: Formula, names: Mapping[str, Any], *, as_written: bool = False) -> Any:
    """The value of a formula where its symbols have the values `names`: numbers, or arrays of one shape; `as_written`
    by the forms that are written where these differ from what is computed. KeyError for a symbol that has no value.
    """
    if formula.number is not None:
        return formula.number
    if formula.name == "named" or formula.name == "shown":
        chosen = formula.inputs[formula.name == "named" or as_written]
        return value_of(chosen, names, as_written=as_written)
    if not formula.inputs:
        return names[formula.name]
    function = _COMPUTED.get(formula.name) or getattr(np, formula.name)
    return function(*(value_of(part, names, as_written=as_written) for part in formula.inputs))
