"""Refinements of the shapes of named effects: which of them the records support."""

from collections.abc import Mapping, Sequence
from operator import attrgetter

from models.effects import CATALOGUE, REFINEMENTS
from models.identification.fitting.fit import Fit
from models.identification.fitting.fitter import Fitter
from models.identification.kind import Kind
from models.identification.search.candidates import better_without
from models.identification.search.fitted_model import FittedModel, fewest
from models.identification.settings import SET
from models.records.record import Record
from models.theta import Theta

Known = Mapping[tuple[str, ...], Sequence[Theta]]
"""Fits on the parts of the splits by model: its effects and refinements in order."""


def refined(model: FittedModel) -> tuple[FittedModel, Known]:
    """`model` with the refinements of the named effects' shapes, and all fits that were made: added one after the
    other, the fewest that do about as well on validation records as the best. Each also begins where it changes
    nothing, and is compared with the model without it, refitted from its base: no result depends on where a fit began.
    """
    curves = _shapes(model.kind, model.effects) if model.training_blocks.mean() > SET.events else []
    rows, known = [model], dict[tuple[str, ...], Sequence[Theta]]()
    for k, curve in enumerate(curves):
        finer = (*model.effects, *curves[: k + 1])
        starts = [[theta.with_(curve, at) for at in ({}, _begin(curve))] for theta in rows[-1].thetas]
        row = rows[-1].far(starts, finer, seeds=1)
        known[finer] = row.thetas
        rows[-1:] = [better_without(rows[-1], curve, row.thetas), row]
    return rows[fewest([row.blocks for row in rows], [row.training_cost for row in rows])], known


def refined_at_last(
    kind: Kind, records: Sequence[Record], effects: Sequence[str], taken: Sequence[str], fit: Fit, known: Known
) -> tuple[list[str], Fit]:
    """The refinements beyond `taken` that `fit`, made at the kind's final criterion, still needs, and the best fit: the
    coarser steps on which shapes are compared may hide one. Started from `fit`, or from a better `known` fit on a part,
    as long as the reported error is above the noise floor. A refinement must be clearly better, also than the model
    without it refitted from its base, and leave about the noise, not `SET.behind` times that as where more is missing.
    """
    added: list[str] = []
    if kind.criteria == 1:
        return added, fit
    for curve in (name for name in _shapes(kind, effects) if name not in taken):
        if _floors(kind, records, fit) < SET.close:
            break
        model = [*effects, *taken, *added, curve]
        starts = [fit.theta.with_(curve, _begin(curve)), *known.get(tuple(model), ())]
        fitter = Fitter.of(kind, records, model, kind.final)
        (start,) = fitter.lowest(starts, 1)
        if min(fit.cost, *fitter.costs([start])) > SET.behind * fit.count:
            break
        finer = fitter.near(start, SET.narrow, SET.rounds)
        if finer.chi2 < SET.near and _clearly(kind, records, finer, fit):
            again = Fitter.of(kind, records, model[:-1], kind.final).near(finer.theta.without(curve), SET.fine)
            fit = min(fit, again, key=attrgetter("cost"))
            if _clearly(kind, records, finer, fit):
                added.append(curve)
                fit = finer
    return added, fit


def _floors(kind: Kind, records: Sequence[Record], fit: Fit) -> float:
    """The reported error over what the noise leaves of it."""
    return kind.error(records, [kind.predict(record, fit.theta) for record in records]) / kind.noise_floor(records)


def _clearly(kind: Kind, records: Sequence[Record], finer: Fit, fit: Fit) -> bool:
    """Whether `finer` is clearly better than `fit`, by its cost or by the reported error."""
    if finer.cost >= (1 - SET.finer_gain) * fit.cost:
        most = (1 - SET.finer_share) * _floors(kind, records, fit)
        return finer.cost < fit.cost and _floors(kind, records, finer) <= most
    return True


def _shapes(kind: Kind, effects: Sequence[str]) -> list[str]:
    """Refinements of the shapes of `effects`."""
    wanted = dict.fromkeys(curve for name in effects for curve in kind.catalogue[name].refined_by)
    return [
        name for name in wanted if kind.name in kind.catalogue[name].kinds and name not in {*effects, *kind.in_base}
    ]


def _begin(curve: str) -> dict[str, float]:
    """Where a refinement starts: first on its grid. An effect that refines another starts as it is declared."""
    effect = CATALOGUE.get(curve)
    return {name: values[0] for name, values in effect.grid.items()} if effect in REFINEMENTS else {}
