"""The value of a formula's text, read again without `eval`: what its writer is tested with."""

import ast
import operator
import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

_WRITTEN: Final = {"abs": np.absolute, "sgn": np.sign, "max": np.maximum, "min": np.minimum}
_FUNCTIONS: Final[Mapping[str, Any]] = {
    **_WRITTEN,
    "where": np.where,
    "clip": np.clip,
}
_COMPUTED: Final[Mapping[type, Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
}


def value_of(text: str, names: Mapping[str, Any]) -> Any:
    """The value of the formula `text`, as `written` has it, where its names have the values `names`: numbers, or arrays
    of one shape.

    Raises ValueError for a text that is no formula, KeyError for a name that has no value.
    """
    whole, *parts = re.split(r", (?=q_\d+ = )", text)
    known = dict(names)
    for part in parts:
        name, _, formula = part.partition(" = ")
        known[name] = _value(formula, known)
    return _value(whole, known)


def _value(text: str, names: Mapping[str, Any]) -> Any:
    try:
        tree = ast.parse(_python(text), mode="eval")
    except SyntaxError as error:
        raise ValueError(f"formula must be one that can be read; got {text!r}: {error.msg}") from None
    return _computed(tree.body, names)


def _python(text: str) -> str:
    """The text as Python has it: bars as calls, a factor after a blank as a product, `^` as a power."""
    while (bare := re.sub(r"\|([^|]*)\|", r"abs(\1)", text)) != text:
        text = bare
    return re.sub(r"(?<=[\w)]) (?=[\w(])", "*", text).replace("^", "**")


def _computed(node: ast.expr, names: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return number
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_computed(operand, names)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _COMPUTED:
            return _COMPUTED[type(op)](_computed(left, names), _computed(right, names))
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPUTED:
            return _COMPUTED[type(op)](_computed(left, names), _computed(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            function: Any = _FUNCTIONS.get(name) or getattr(np, name, None)
            if name in _FUNCTIONS or isinstance(function, np.ufunc):
                return function(*(_computed(argument, names) for argument in arguments))
    raise ValueError(f"formula must hold sums, products, powers, comparisons and functions; got {ast.unparse(node)}")
