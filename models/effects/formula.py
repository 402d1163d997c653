"""Formulas as trees: a symbol that remembers what is done with it, how that is written, and its value.

A law that is written once with NumPy functions is called with `Formula` symbols in place of numbers; what it returns is
the law as a tree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
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
    (`+ - * / ^`, a comparison, `neg`) or of the function; `inputs` are what it works on.
    """

    name: str
    inputs: tuple[Formula, ...] = ()
    number: float | None = None

    @classmethod
    def of(cls, value: Any) -> Formula:
        """`value` as a formula."""
        return value if isinstance(value, Formula) else cls("", number=float(value))

    def __format__(self, spec: str) -> str:
        """The formula in an f-string, where a number with the digits `spec` would stand; in brackets if need be."""
        text = written(self)
        bare = f"({text})" if self.name in ("+", "neg") else text
        return f"+ {bare}" if spec.startswith("+") else bare

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
    for one, other in ((a, b), (b, a)):
        if one.name == "neg" or (one.number or 0) < 0:
            return _negative(_product(_negative(one), other))
    return Formula("*", (b, a) if b.number is not None else (a, b))


def _quotient(a: Formula, b: Formula) -> Formula:
    if (numbers := _numbers(a, b)) is not None:
        return Formula.of(numbers[0] / numbers[1])
    if a.name == "neg":
        return _negative(_quotient(a.inputs[0], b))
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
_LEAST_NAMED: Final = 6
"""Characters from which a part that stands twice gets a name of its own."""


def written(formula: Formula, digits: int | None = None) -> str:
    """The formula as text; parts that stand in it more than once follow it, as `..., with q1 = ..., q2 = ...`. Numbers
    have `digits` significant digits, else as many as it takes to read them back.
    """
    return _Writing(formula, digits).text()


class _Writing:
    """One formula on its way to text: how often each part stands in it, and the names of those that stand twice."""

    def __init__(self, formula: Formula, digits: int | None) -> None:
        self._formula, self._digits = formula, digits
        self._uses: dict[int, int] = {}
        self._named: dict[int, str] = {}
        self._parts: list[str] = []
        self._count(formula)

    def text(self) -> str:
        """The formula, then its named parts, each before it is used by a later one."""
        whole = self._text(self._formula, _COMPARED)
        return f"{whole}, with {', '.join(self._parts)}" if self._parts else whole

    def _count(self, formula: Formula) -> None:
        self._uses[id(formula)] = self._uses.get(id(formula), 0) + 1
        if self._uses[id(formula)] == 1:
            for part in formula.inputs:
                self._count(part)

    def _text(self, formula: Formula, binds: int) -> str:
        if id(formula) in self._named:
            return self._named[id(formula)]
        text, own = self._plain(formula)
        if (
            formula is not self._formula
            and formula.inputs
            and self._uses[id(formula)] > 1
            and len(text) >= _LEAST_NAMED
        ):
            name = f"q{len(self._named) + 1}"
            self._named[id(formula)] = name
            self._parts.append(f"{name} = {text}")
            return name
        return text if own >= binds else f"({text})"

    def _plain(self, formula: Formula) -> tuple[str, int]:
        """The text and how tightly it binds."""
        name, inputs = formula.name, formula.inputs
        if formula.number == math.tau and self._digits is not None:
            return "2*pi", _PRODUCT
        if formula.number is not None:
            return self._number(formula.number), _SUM if formula.number < 0 else _ATOM
        if name == "+":
            left, right = inputs
            sign, right = (
                (" - ", _negative(right)) if right.name == "neg" or (right.number or 0) < 0 else (" + ", right)
            )
            return self._text(left, _SUM) + sign + self._text(right, _PRODUCT if sign == " - " else _SUM), _SUM
        if name == "neg":
            return f"-{self._text(inputs[0], _PRODUCT)}", _SUM
        if name in "*/":
            return self._text(inputs[0], _PRODUCT) + name + self._text(inputs[1], _POWER), _PRODUCT
        if name == "^":
            return f"{self._text(inputs[0], _ATOM)}^{self._text(inputs[1], _ATOM)}", _POWER
        if name in _COMPARISONS.values():
            return f"{self._text(inputs[0], _SUM)} {name} {self._text(inputs[1], _SUM)}", _COMPARED
        return (f"{name}({', '.join(self._text(part, _COMPARED) for part in inputs)})" if inputs else name), _ATOM

    def _number(self, number: float) -> str:
        if self._digits is not None:
            return f"{number:.{self._digits}g}"
        return str(int(number)) if number == int(number) and abs(number) < 1e6 else repr(number)


_COMPUTED: Final[Mapping[str, Callable[..., Any]]] = {
    **{"+": np.add, "*": np.multiply, "/": np.divide, "^": np.power, "neg": np.negative},
    **{sign: getattr(np, name) for name, sign in _COMPARISONS.items()},
    **{written: getattr(np, name) for name, written in _WRITTEN.items()},
}


def value_of(formula: Formula, names: Mapping[str, Any]) -> Any:
    """The value of a formula where its symbols have the values `names`: numbers, or arrays of one shape. KeyError for a
    symbol that has none.
    """
    if formula.number is not None:
        return formula.number
    if not formula.inputs:
        return names[formula.name]
    function = _COMPUTED.get(formula.name) or getattr(np, formula.name)
    return function(*(value_of(part, names) for part in formula.inputs))
