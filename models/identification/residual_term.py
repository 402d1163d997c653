"""The term that is proposed for a curve: the shortest form of a small library, else straight lines between knots."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
import scipy

from models.effects import shapes
from models.files.units import unit_at_end
from models.formula import Formula, called, equal, written
from models.identification.finding import Fitted, ResidualCurve, Term
from models.identification.kind import Array
from models.identification.settings import SET
from models.words.quantities import quantity

SYMBOLS: Final[Mapping[str, tuple[str, str]]] = {
    "t_s": ("t", "s.t"),
    "x_m": ("x", "s.x"),
    "x_rad": ("x", "s.x"),
    "v_m_s": ("v", "s.v"),
    "v_rad_s": ("v", "s.v"),
    "gap_m": ("gap", "s.command - s.x"),
    "travelled_m": ("travelled", "s.travelled"),
    "load_N": ("load", "s.load"),
    "load_N_m": ("load", "s.load"),
}
"""What an effect can depend on: a signal's symbol in formulas, and its name in a hook."""
UNITS: Final[Mapping[str, str]] = {"t": "s", "x": "m", "v": "m/s", "gap": "m", "travelled": "m", "load": "N"}


@dataclass(frozen=True)
class Form:
    """A shape of `models.effects.shapes`: for each fitted number its starts and bounds, relative to the curve's span (a
    `middle` is counted from where the curve begins; `PURE` numbers have no unit). `fixed` numbers, the beginning or
    size of the span, are not fitted.
    """

    name: str
    numbers: Mapping[str, tuple[tuple[float, ...], float, float]]
    fixed: tuple[str, ...] = ()

    def at(self, z: Any, numbers: Mapping[str, Any], given: Mapping[str, Any]) -> Any:
        """The shape over `z`."""
        return getattr(shapes, self.name)(z, **numbers, **given)


PURE: Final = ("slope", "phase")
"""Numbers without the variable's unit."""
_POWERS: Final[Mapping[str, int]] = {"line": 1, "parabola": 2}
_NOTHING: Final = 1e-6  # of the amplitude: no constant
# starts, least and most of a form's middle over the signal's span
_MIDDLE: Final = ((0.15, 0.35, 0.5, 0.65, 0.85), -0.5, 1.5)
_WIDTH: Final = ((0.05, 0.2, 0.5), 0.01, 3.0)  # the same of its width
_CYCLES: Final = tuple(1 / k for k in (0.7, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8))
FORMS: Final = (
    Form("line", {}, ("scale",)),
    Form("parabola", {"middle": _MIDDLE}, ("scale",)),
    Form("decay", {"length": _WIDTH}, ("begin",)),
    Form("step", {"middle": _MIDDLE, "width": _WIDTH}),
    Form("bump", {"middle": _MIDDLE, "width": _WIDTH}),
    Form("wave", {"length": (_CYCLES, 0.08, 2.0), "phase": ((0.0, 2.0, 4.0), -7.0, 7.0)}),
    Form("line_and_decay", {"slope": ((0.02, 0.1, 0.4), -5.0, 5.0), "length": _WIDTH}, ("begin",)),
)
"""The library of short forms, from the fewest numbers to the most."""


def term_of(curve: ResidualCurve, unit: str, level: float) -> Term | None:
    """The term that follows `curve` in `unit`, `level` the mean resistance; None where no effect has its signal."""
    if curve.variable not in SYMBOLS:
        return None
    fits = [_Fitted.best(form, curve) for form in FORMS]
    short = [fit for fit in fits if fit.left <= SET.followed]
    chosen = min(short, key=lambda fit: fit.criterion) if short else _knotted(curve)
    return chosen.term(unit, level)


@dataclass(frozen=True)
class _Fitted:
    """A form fitted to a curve: `values` are amplitude, constant and the form's numbers."""

    form: Form
    curve: ResidualCurve
    given: Mapping[str, Any]
    values: Array

    @classmethod
    def best(cls, form: Form, curve: ResidualCurve) -> _Fitted:
        """The best fit from the form's starts; amplitude and constant follow from the other numbers."""
        z, begin, span = curve.centres, float(curve.centres.min()), float(np.ptp(curve.centres))
        given = {name: {"scale": span, "begin": begin}[name] for name in form.fixed}
        weight = 1 / _errors(curve)

        def scaled(q: Array) -> dict[str, float]:
            return {
                name: value if name in PURE else value * span + (begin if name == "middle" else 0.0)
                for name, value in zip(form.numbers, q, strict=True)
            }

        def linear(q: Array) -> tuple[Array, Array]:
            columns = np.stack([form.at(z, scaled(q), given), np.ones_like(z)], axis=1) * weight[:, None]
            found = np.linalg.lstsq(columns, curve.values * weight, rcond=None)[0]
            return np.asarray(found), np.asarray(columns @ found - curve.values * weight)

        rows = list(form.numbers.values())
        starts = [np.array(start) for start in itertools.product(*(row[0] for row in rows))]
        starts.sort(key=lambda q: _square(linear(q)))
        ends = starts[:1]
        if rows:
            bounds = ([row[1] for row in rows], [row[2] for row in rows])
            ends = [
                scipy.optimize.least_squares(lambda q: linear(q)[1], q, bounds=bounds).x
                for q in starts[: SET.term_starts]
            ]
        q = min(ends, key=lambda end: _square(linear(end)))
        values = np.concatenate([linear(q)[0], list(scaled(q).values())])
        if form.name == "wave":  # of the same waves the one that rises within half a turn
            values[3] = np.angle(values[0] * np.exp(1j * values[3]))
            values[0] = abs(values[0])
        return cls(form, curve, given, values)

    def at(self, z: Any, values: Array | None = None) -> Any:
        """The term over `z`."""
        amplitude, constant, *numbers = self.values if values is None else values
        return constant + amplitude * self.form.at(z, dict(zip(self.form.numbers, numbers, strict=True)), self.given)

    @cached_property
    def deviations(self) -> Array:
        """Standard deviations of the values by least squares, widened for the misfit of the form."""
        z, weight = self.curve.centres, 1 / _errors(self.curve)
        here = scipy.optimize.least_squares(
            lambda values: weight * self.at(z, values), self.values, "3-point", diff_step=1e-4, max_nfev=1
        )
        jacobian = here.jac
        scale = np.linalg.norm(jacobian, axis=0)
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv((jacobian / scale).T @ (jacobian / scale), rcond=1e-10)
        wide = max(self._cost() / max(len(z) - len(self.values), 1), 1.0)
        return np.asarray(np.sqrt(np.maximum(np.diag(inverse), 0.0) * wide) / scale)

    def _cost(self) -> float:
        return float(np.sum(((self.at(self.curve.centres) - self.curve.values) / _errors(self.curve)) ** 2))

    @property
    def criterion(self) -> float:
        """Bayes' information criterion."""
        return self._cost() + len(self.values) * float(np.log(len(self.curve.values)))

    @property
    def left(self) -> float:
        """Share of the curve's variance, beyond its own uncertainty, that the form does not follow."""
        chance = float(np.sum(_errors(self.curve) ** 2))
        wrong = float(np.sum((self.at(self.curve.centres) - self.curve.values) ** 2)) - chance
        whole = float(np.sum((self.curve.values - self.curve.values.mean()) ** 2)) - chance
        return max(wrong, 0.0) / max(whole, 1e-300)

    def term(self, unit: str, level: float) -> Term:
        """The term as it is reported."""
        curve, own, found = self.curve, unit_at_end(self.curve.variable)[1], dict[str, Fitted]()
        units = {"amplitude": unit, "constant": unit} | {n: "1" if n in PURE else own for n in self.form.numbers}
        for (name, of), v, d in zip(units.items(), self.values, SET.z95 * self.deviations, strict=True):
            most = np.pi / 2 if name == "phase" else 0.5 * abs(v)  # half width up to which a value is identifiable
            found[name] = Fitted(float(v), (float(v - d), float(v + d)), of, bool(d < most))
        amplitude, constant = found.pop("amplitude"), found.pop("constant")
        offset, given = float(self.values[1] / self.values[0]), dict(self.given)
        shape = (curve.variable, curve.along, curve.sized, self.form.name)
        term = Term(*shape, "", amplitude, constant, offset, found, given, level, self.left)
        return replace(term, text=_text(term))


def law_of(term: Term) -> Formula:
    """The force of a term as an equation in the letters of `numbers_of`."""
    symbol: Any = Formula(SYMBOLS[term.variable][0])
    z = np.abs(symbol) if term.sized else symbol
    own = {name: Formula(letter) for name, (letter, _) in numbers_of(term).items()}
    constant, size = own.pop("constant", 0.0), own.pop("size")
    if term.form in _POWERS:
        force = constant + size * (z - own.get("middle", 0.0)) ** _POWERS[term.form]
    elif term.form == "knots":
        force = called(size.name, z)
    else:
        given = {name: own.get(name, 0.0) for name in term.given}
        force = constant + size * getattr(shapes, term.form)(z, **own | given)
    return equal(Formula("F_extra"), -np.sign(Formula("v")) * force if term.along == "-v" else force)


def numbers_of(term: Term) -> dict[str, tuple[str, Fitted]]:
    """Letter and estimate of each number of `law_of`. A line and a parabola have a coefficient in place of a size."""
    symbol, size = SYMBOLS[term.variable][0], term.amplitude
    own, power = unit_at_end(term.variable)[1], _POWERS.get(term.form, 0)
    per = float(np.max(term.given.get("scale", 1.0))) ** power
    bare = own if own.isalpha() else f"({own})"
    unit = (size.unit, f"{size.unit}/{bare}", f"{size.unit}/{bare}^2")[power]
    ends = size.ci95[0] / per, size.ci95[1] / per
    found = {"size": ("k" if power else "F_1", Fitted(size.value / per, ends, unit, size.identifiable))}
    if term.form != "knots" and abs(term.offset) > _NOTHING:
        found = {"constant": ("F_0", term.constant)} | found
    letters = {"length": "L", "width": "w", "slope": "s", "phase": "phi", "middle": f"{symbol}_0"}
    found |= {name: (letters[name], estimate) for name, estimate in term.numbers.items()}
    if begin := float(np.max(term.given.get("begin", 0.0))):
        found["begin"] = (f"{symbol}_b", Fitted(begin, (math.nan, math.nan), own, True))
    return found


def points_of(term: Term) -> list[tuple[str, str]]:
    """Place and force of each knot of a term of straight lines, as quantities; else none."""
    own, size = unit_at_end(term.variable)[1], term.amplitude
    places, heights = (np.atleast_1d(term.given.get(name, ())) for name in ("places", "values"))
    forces = size.value * (term.offset + heights)
    return [(quantity(z, own), quantity(f, size.unit)) for z, f in zip(places, forces, strict=True)]


def _text(term: Term) -> str:
    """The law, then its numbers with their units."""
    if points := points_of(term):
        return f"{written(law_of(term))}, straight between {', '.join(f'{z}: {force}' for z, force in points)}"
    numbers = (f"{letter} = {quantity(one.value, one.unit)}" for letter, one in numbers_of(term).values())
    return f"{written(law_of(term))}, {', '.join(numbers)}"


def _errors(curve: ResidualCurve) -> Array:
    """Standard deviations of a curve's values, none much smaller than the median's."""
    error: Array = (curve.high - curve.low) / (2 * SET.z95)
    return np.maximum(error, max(0.3 * float(np.median(error)), 1e-12 * float(np.ptp(curve.values)) + 1e-300))


def _square(fit: tuple[Array, Array]) -> float:
    return float(fit[1] @ fit[1])


def _knotted(curve: ResidualCurve) -> _Fitted:
    """Straight lines between knots at equally many of the curve's points, with one amplitude for all."""
    z = curve.centres
    knots = np.quantile(z, np.linspace(0, 1, min(SET.term_knots, len(z))))
    hats = np.stack([np.interp(z, knots, row) for row in np.eye(len(knots))], axis=1)
    weight = 1 / _errors(curve)
    heights = np.linalg.lstsq(hats * weight[:, None], curve.values * weight, rcond=None)[0]
    constant = float(heights.mean())
    size = float(np.max(np.abs(heights - constant))) or 1.0
    given = {
        "places": tuple(float(p) for p in knots),
        "values": tuple(float(h) for h in (heights - constant) / size),
    }
    return _Fitted(Form("knots", {}), curve, given, np.array([size, constant]))
