"""CasADi's operations in machine arithmetic, with elementary functions.

Exponential, logarithm, power, sine and cosine after fdlibm (Sun Microsystems 1993): argument reduction, then a
polynomial; within 2 units in the last place over the ranges stated, hyperbolic functions made of them within 4. A call
into the C library would keep a loop over parameter sets from being vectorised, which costs a factor of four. The
compiler may contract a product and a sum to one operation with one rounding, and multiply by a reciprocal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from llvmlite import ir

from models.files.toml import beside

_ROUND = 6755399441055744.0  # 1.5 * 2^52: what is added to it is rounded to a whole number in its low bits
_FDLIBM: dict[str, list[float]] = beside(__file__, "arithmetic.toml")
_LN2, _PIO2, _EXP, _LOG, _SIN, _COS = (_FDLIBM[name] for name in ("ln2", "half_pi", "exp", "log", "sin", "cos"))
_SINH = tuple(1.0 / math.factorial(n) for n in range(3, 18, 2))
_LONGEST_PRODUCT = 16  # largest power that is written as a product
_INT, _REAL = ir.IntType(64), ir.DoubleType()


def _raw(x: Number | float) -> Any:
    return x.value if isinstance(x, Number) else ir.Constant(_REAL, x)


def _written(instruction: str, swapped: bool = False) -> Callable[[Number, Number | float], Number]:
    def operator(one: Number, other: Number | float) -> Number:
        first, second = (_raw(other), one.value) if swapped else (one.value, _raw(other))
        return Number(one.builder, getattr(one.builder, instruction)(first, second, flags=("contract", "arcp")))

    return operator


class Number:
    """A double in the code being written: Python's operators write machine operations."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    __add__ = __radd__ = _written("fadd")
    __mul__ = __rmul__ = _written("fmul")
    __sub__, __rsub__ = _written("fsub"), _written("fsub", swapped=True)
    __truediv__, __rtruediv__ = _written("fdiv"), _written("fdiv", swapped=True)

    def __neg__(self) -> Number:
        return Number(self.builder, self.builder.fneg(self.value))

    def when(self, relation: str, other: Number | float, then: Number | float, otherwise: Number | float) -> Number:
        """`then` where this number stands in `relation` to `other`, else `otherwise`; only `!=` is true of NaN."""
        compare = self.builder.fcmp_unordered if relation == "!=" else self.builder.fcmp_ordered
        holds = compare(relation, self.value, _raw(other))
        return Number(self.builder, self.builder.select(holds, _raw(then), _raw(otherwise)))

    @property
    def bits(self) -> Any:
        """This number's bits as a whole number."""
        return self.builder.bitcast(self.value, _INT)

    def made_of(self, bits: Any) -> Number:
        """The double of these bits."""
        return Number(self.builder, self.builder.bitcast(bits, _REAL))

    def called(self, name: str, *others: Number) -> Number:
        """The C library's or the processor's function `name` of this number and `others`."""
        kind = ir.FunctionType(_REAL, [_REAL] * (1 + len(others)))
        module = self.builder.module
        function = module.globals.get(name) or ir.Function(module, kind, name)
        return Number(self.builder, self.builder.call(function, [self.value, *(other.value for other in others)]))


def _polynomial(coefficients: Sequence[float], z: Number) -> Number:
    """`c0 + c1 z + c2 z^2 + ...`."""
    *rest, last = coefficients
    y: Any = last
    for c in reversed(rest):
        y = c + z * y
    return y  # type: ignore[no-any-return]


def _exp(x: Number) -> Number:
    """e^x; below -708 as at -708 (3e-308), above 709 as at 709 (8e307)."""
    x = x.when(">", 709.0, 709.0, x)
    x = x.when("<", -708.0, -708.0, x)
    whole = x * 1.44269504088896338700e00 + _ROUND
    k = whole - _ROUND
    high, low = x - k * _LN2[0], k * _LN2[1]
    r = high - low
    t = r * r
    c = r - t * _polynomial(_EXP, t)
    b = x.builder
    scale = x.made_of(b.shl(b.add(whole.bits, ir.Constant(_INT, 1023)), ir.Constant(_INT, 52)))
    return (1.0 - ((low - r * c / (2.0 - c)) - high)) * scale


def _sinh(x: Number) -> Number:
    """sinh x: the series near 0, where the exponentials cancel; beyond 709 as at 709 (4e307)."""
    e, z = _exp(x), x * x
    near = x + x * z * _polynomial(_SINH, z)
    return z.when("<", 1.0, near, 0.5 * (e - 1.0 / e))


def _cosh(x: Number) -> Number:
    """cosh x; beyond 709 as at 709 (4e307)."""
    e = _exp(x)
    return 0.5 * (e + 1.0 / e)


def _log(x: Number) -> Number:
    """ln x of a normal number; -inf at 0, NaN below it."""
    b = x.builder
    # the fraction lies between sqrt(1/2) and sqrt(2)
    shift = b.ashr(b.sub(x.bits, ir.Constant(_INT, 0x3FE6A09E667F3BCD)), ir.Constant(_INT, 52))
    f = x.made_of(b.sub(x.bits, b.shl(shift, ir.Constant(_INT, 52)))) - 1.0
    k = x.made_of(b.add(shift, ir.Constant(_INT, 0x4338000000000000))) - _ROUND
    s = f / (2.0 + f)
    z = s * s
    half = 0.5 * f * f
    y = k * _LN2[0] - ((half - (s * (half + z * _polynomial(_LOG, z)) + k * _LN2[1])) - f)
    y = x.when("==", 0.0, float("-inf"), x.when(">", 0.0, y, float("nan")))
    return x.when("==", float("inf"), x, y)


def _log1p(x: Number) -> Number:
    """ln(1 + x) for x > -1."""
    u = 1.0 + x
    return _log(u) + (x - (u - 1.0)) / u


def _power(x: Number, y: Number) -> Number:
    """x^y for x >= 0, relative error of about |y ln x| units in the last place; NaN for a negative x."""
    at_zero = y.when(">", 0.0, 0.0, y.when("==", 0.0, 1.0, float("inf")))
    return x.when(">", 0.0, _exp(y * _log(x)), x.when("==", 0.0, at_zero, float("nan")))


def _turned(x: Number, quarters: int) -> Number:
    """sin(x + quarters pi/2), |x| < 8e5 rad."""
    b = x.builder
    whole = x * 6.36619772367581382433e-01 + _ROUND
    k = whole - _ROUND
    r = ((x - k * _PIO2[0]) - k * _PIO2[1]) - k * _PIO2[2]
    z = r * r
    sine = r + r * z * _polynomial(_SIN, z)
    cosine = 1.0 - (0.5 * z - z * z * _polynomial(_COS, z))
    n = b.add(whole.bits, ir.Constant(_INT, quarters))
    odd = b.trunc(n, ir.IntType(1))
    sign = b.shl(b.and_(n, ir.Constant(_INT, 2)), ir.Constant(_INT, 62))
    return x.made_of(b.xor(b.bitcast(b.select(odd, cosine.value, sine.value), _INT), sign))


def _raised(x: Number, y: Number) -> Number:
    """A power with a whole constant exponent is a product."""
    exponent = y.value.constant if isinstance(y.value, ir.Constant) else 0.5
    if not float(exponent).is_integer() or not 1 <= abs(exponent) <= _LONGEST_PRODUCT:
        return _power(x, y)
    product = x
    for _ in range(round(abs(exponent)) - 1):
        product = product * x
    return product if exponent > 0 else 1.0 / product


def _truth(relation: str) -> Callable[[Number, Number], Number]:
    return lambda x, y: x.when(relation, y, 1.0, 0.0)


def _library(name: str) -> Callable[..., Number]:
    return lambda x, *others: x.called(name, *others)


OPERATIONS: dict[str, Callable[..., Number]] = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "div": lambda x, y: x / y,
    "pow": _raised,
    "constpow": _raised,
    "fmin": lambda x, y: x.when("<", y, x, y),
    "fmax": lambda x, y: x.when(">", y, x, y),
    "lt": _truth("<"),
    "le": _truth("<="),
    "eq": _truth("=="),
    "ne": _truth("!="),
    "and": lambda x, y: x.when("!=", 0.0, y.when("!=", 0.0, 1.0, 0.0), 0.0),
    "or": lambda x, y: x.when("!=", 0.0, 1.0, y.when("!=", 0.0, 1.0, 0.0)),
    "if_else_zero": lambda x, y: x.when("!=", 0.0, y, 0.0),
    "assign": lambda x: x,
    "neg": lambda x: -x,
    "sq": lambda x: x * x,
    "twice": lambda x: x + x,
    "inv": lambda x: 1.0 / x,
    "fabs": _library("llvm.fabs.f64"),
    "sign": lambda x: x.when(">", 0.0, 1.0, x.when("<", 0.0, -1.0, 0.0)),
    "not": lambda x: x.when("==", 0.0, 1.0, 0.0),
    "exp": _exp,
    "expm1": lambda x: 2.0 * _sinh(0.5 * x) * _exp(0.5 * x),
    "sinh": _sinh,
    "cosh": _cosh,
    "tanh": lambda x: _sinh(x) / _cosh(x),
    "log": _log,
    "log1p": _log1p,
    "sin": lambda x: _turned(x, 0),
    "cos": lambda x: _turned(x, 1),
    **{name: _library(f"llvm.{name}.f64") for name in ("sqrt", "floor", "ceil", "copysign")},
    **{name: _library(name) for name in ("tan", "atan", "asin", "acos", "erf", "atan2", "fmod", "hypot")},
}
"""CasADi's operations by their names without `OP_`."""
