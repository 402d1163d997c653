"""Profile likelihood of each fitted parameter: how the fit worsens where it is held elsewhere and the others follow."""

from collections.abc import Sequence

import numpy as np
import scipy

from models.identification.finding import Profile
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter
from models.identification.intervals import inverse_of, memory, near
from models.identification.kind import Kind
from models.identification.settings import SET
from models.records.record import Record
from models.theta import spelled
from models.words.quantities import measured_unit
from models.workers import each

LINE = float(scipy.special.chdtri(1, 0.05)) / 2
"""The drop in log-likelihood at the ends of a 95 % interval."""


def profiles(kind: Kind, fit: Fit, effects: Sequence[str], records: Sequence[Record]) -> tuple[Profile, ...]:
    """The profile of each parameter of the `fit` of `kind` with `effects`, within about three standard deviations."""
    fitter = Fitter.of(kind, records, effects, kind.final)
    return tuple(each(lambda k: _profile(fitter, fit, k), range(len(fitter.axes))))


def _profile(fitter: Fitter, fit: Fit, k: int) -> Profile:
    """That of parameter number `k`. At each value the others go along their conditional direction, then Gauss-Newton
    steps with the fit's derivatives; the lowest real cost counts, widened as the intervals are for a misfit and for
    memory.
    """
    x, wide, axis = fitter.at(fit.theta), max(fit.chi2, 1.0) * memory(fit.residual), fitter.axes[k]
    scale, p, others = np.array([one.scale for one in fitter.axes]), axis.parameter, np.arange(len(x)) != k
    rows = fit.jacobian * scale
    inverse = inverse_of(rows)
    reach = SET.profile_reach * np.sqrt(wide * inverse[k, k]) * scale[k]
    reach = min(reach, SET.profile_widest * max(abs(x[k]), scale[k]))
    values = np.unique(np.clip(x[k] + np.linspace(-reach, reach, SET.profile_points), p.lower, p.upper))
    along = inverse[:, k] / inverse[k, k] * scale / scale[k]
    back = inverse_of(rows[:, others]) @ rows[:, others].T
    moved = [x + (value - x[k]) * along for value in values]
    costs = np.full(len(values), np.inf)
    for _ in range(1 + SET.profile_rounds):
        moved = [fitter.clip(point) for point in moved]
        for point, value in zip(moved, values, strict=True):
            point[k] = value
        found = fitter.residuals(moved)
        costs = np.minimum(costs, np.einsum("ij,ij->i", found, found))
        for point, r in zip(moved, found, strict=True):
            point[others] -= back @ r * scale[others]
    drops = np.maximum(costs - min(fit.cost, float(costs.min())), 0.0) / (2 * wide)
    ends = ((values[0], p.lower, drops[0], "lower"), (values[-1], p.upper, drops[-1], "upper"))
    unshown = tuple(name for value, bound, drop, name in ends if near(value, bound, p) and drop < LINE)
    unit = measured_unit(p.unit, fitter.kind.unit)
    return Profile(spelled(axis.name), float(x[k]), unit, tuple(values.tolist()), tuple(drops.tolist()), unshown)
