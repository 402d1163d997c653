"""What a controller may choose from: models that the records leave possible, stages that must not lead as they are."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Final

import numpy as np
import scipy

from models.identification.experiment import Candidate, root_of
from models.identification.finding import STAGES
from models.identification.fitting.fit import FreeParameter
from models.identification.fitting.fitter import Fitter
from models.identification.intervals import memory
from models.identification.kind import Array
from models.identification.kinds.reports import AnyKind
from models.identification.kinds.series.drive_input import interval
from models.identification.kinds.series.series import SeriesKind
from models.identification.model import CLASS, DRAW
from models.identification.search.search import Search
from models.identification.settings import SET
from models.identification.steps import Choice, Judged, Predicted, Prepared
from models.identification.verdict import at_bounds
from models.parameter import Name
from models.records.record import Record
from models.rigs.kinds import KINDS
from models.theta import Theta
from models.words.sentences import Quantity, Sentences
from models.workers import each

TEXT: Final = Sentences(__file__)


def choice_of(
    prepared: Prepared, found: Search, predicted: Predicted, judged: Judged, train: Sequence[Record], seed: int
) -> Choice:
    """The choice that a model carries; empty for a rig whose capsule is not driven."""
    rig = KINDS[prepared.kind.name]
    if not rig.of_capsule or rig.imposed or not isinstance(prepared.kind, SeriesKind):
        return Choice()
    errors = predicted.error["holdout"] or predicted.error["train"]
    not_to_lead = barred(prepared, found, judged)
    excluded = refuted(judged.verdict, errors, not_to_lead, prepared.kind.error_unit)
    members = members_of(prepared.kind, train, found, SET.refuted * predicted.error["train"][STAGES[-1]])
    able = [*([] if STAGES[-1] in not_to_lead else [predicted.thetas[STAGES[-1]]]), *members.values()]
    mean = {CLASS: mean_of(prepared.kind, able)} if len(able) > 1 else {}
    possible = {**members, **mean, **dict(_draws(prepared, found, seed))}
    if absorbs(judged, found, errors):
        not_to_lead |= dict.fromkeys(STAGES[1:], TEXT("absorbs"))
        excluded |= dict.fromkeys(STAGES[1:], TEXT("absorbs"))
        possible = {}
    worlds = {**predicted.thetas, **possible}
    left = {name: left_by(prepared.kind, train, theta) for name, theta in worlds.items() if name not in excluded}
    return Choice(possible, not_to_lead, excluded, {name: push for name, push in left.items() if push})


def members_of(kind: SeriesKind, records: Sequence[Record], found: Search, most: float) -> dict[str, Theta]:
    """The models with each effect that the search did not separate from a found one in its place, fitted to all
    `records`; none that then errs by more than `most`.
    """
    rivals = [rival for *_, rival in found.doubts]
    fits = each(lambda one: held(kind, records, one.fitted.effects, one.fitted.thetas[0]), rivals)
    members = {rival.effect: theta for rival, theta in zip(rivals, fits, strict=True)}
    errors = {name: kind.error(records, [kind.predict(r, theta) for r in records]) for name, theta in members.items()}
    return {name: theta for name, theta in members.items() if errors[name] <= most}


def held(kind: SeriesKind, records: Sequence[Record], effects: Sequence[str], start: Theta) -> Theta:
    """The fit to `records` with `effects` whose base stays as near to the rig file's as they allow, from `start` and
    from where its base is half as far off or not at all. A number is known to `SET.rig_known` of its value, beside what
    a residual beyond chance, which is not independent, tells: numbers that make up for each other thus stand where rigs
    have them, and not at a bound.
    """
    fitter, nominal = Fitter.of(kind, records, effects, kind.final), kind.nominal()
    base = [axis.name for axis in fitter.axes if not axis.parameter.effect]
    start = nominal | start
    points = [
        start | {name: nominal[name] + share * (start[name] - nominal[name]) for name in base} for share in (1, 0.5, 0)
    ]
    for _ in range(2):  # once fitted the residual tells how well it does
        (residual,) = fitter.residuals([fitter.at(start)])
        width = SET.rig_known / np.sqrt(max(float(np.mean(residual**2)) * memory(residual), 1.0))
        prior = replace(fitter, axes=[_known(axis, width) for axis in fitter.axes])
        start = min((prior.near(point, SET.narrow, SET.rounds) for point in points), key=attrgetter("cost")).theta
        points = [start]
    return start


def _known(axis: FreeParameter, width: float) -> FreeParameter:
    """A number of the base with a prior, a share `width` of its value wide; another as it is."""
    p = axis.parameter
    if p.effect or not p.value:
        return axis
    return replace(axis, parameter=replace(p, spread=min(p.spread, width * abs(p.value))))


def mean_of(kind: AnyKind, members: Sequence[Theta]) -> Theta:
    """The mean of the `members` of a class, an absent effect with size 0: what it lacks in each of their worlds is a
    part of what they lack in each other's. The numbers of an effect's shape are the mean of those that have it.
    """
    values = dict[Name, float]()
    for name in dict.fromkeys(name for theta in members for name in theta):
        own = [theta[name] for theta in members if name in theta]
        size = not isinstance(name, str) and name[1] == kind.declared(name[0]).amplitude().name
        values[name] = sum(own) / (len(members) if size else len(own))
    return Theta.of(values)


def _draws(prepared: Prepared, found: Search, seed: int) -> Iterator[tuple[str, Theta]]:
    """The last model with its numbers drawn from their covariance."""
    kind, fit, rng = prepared.kind, found.augmented, np.random.default_rng(seed)
    root = root_of(kind, fit, found.model, max(fit.chi2 * memory(fit.residual), 1.0))
    last = Candidate("", tuple(found.model), kind.nominal() | fit.theta)
    for number in range(1, SET.possible_draws + 1 if root.size else 1):
        yield f"{DRAW}{number}", last.moved(kind, root @ rng.standard_normal(len(root)))


def left_by(kind: SeriesKind, records: Sequence[Record], theta: Theta) -> dict[str, float]:
    """The force that a model at `theta` lacks on `records`: rms in N and correlation time in s. Empty where it errs
    like the noise, on a surface without friction, and where nothing moves.
    """
    runs = [(record, kind.predict(record, theta)) for record in records]
    error, floor = kind.error(records, [run for _, run in runs]), kind.noise_floor(records)
    slope = _slope(kind, runs, theta) if error >= SET.unexplained * floor else 0.0
    if slope == 0:
        return {}
    times = [interval(record) * _memory(kind.off(record, run)) for record, run in runs]
    return {"force_N": slope * float(np.sqrt(error**2 - floor**2)), "time_s": float(np.mean(times))}


def _slope(kind: SeriesKind, runs: Sequence[tuple[Record, Array]], theta: Theta) -> float:
    """The force in N that moves free `runs` at `theta` by a metre: of a magnet, else of a greater friction, else 0."""
    extra = [found[0] for record, _ in runs if (found := kind.extra_force(record, theta))]
    if extra:
        moved = _rms([record[kind.quantity] - run for record, run in runs])
        return _rms(extra) / moved if moved else 0.0
    scale = next((p.name for p in kind.surface.parameters()), "")
    harder = theta | {scale: SET.harder * theta[scale]} if scale else theta
    low, high = (sum(kind.surface.hold(SET.pushed_m_s, own.base, kind.drive.carried_kg)) for own in (theta, harder))
    moved = _rms([kind.predict(record, harder) - run for record, run in runs])
    return float(high - low) / moved if moved else 0.0


def _rms(signals: Sequence[Array]) -> float:
    return float(np.sqrt(np.nanmean(np.concatenate(signals) ** 2)))


def _memory(signal: Array) -> int:
    """Samples after which the autocorrelation of `signal` falls below 1/e."""
    rest = signal - signal.mean()
    alike = scipy.signal.correlate(rest, rest, method="fft")[len(rest) - 1 :]
    return max(1, int(np.argmax(alike < alike[0] / np.e)))


def barred(prepared: Prepared, found: Search, judged: Judged) -> dict[str, str]:
    """Why a stage must not lead: a parameter stands at its bound, or it errs more held out than an earlier one."""
    said = dict(judged.worse)
    calibrated = at_bounds(prepared.kind, found.calibrated, [])
    unknown = judged.verdict == "unknown"
    last = at_bounds(prepared.kind, found.augmented, found.effects, found.refinements) if unknown else []
    for stage, bounds in (("calibrated", calibrated), ("augmented", last)):
        if bounds:
            said[stage] = TEXT("bounds", parameters=bounds, n=len(bounds))
    return said


def absorbs(judged: Judged, found: Search, errors: Mapping[str, float]) -> bool:
    """Whether the calibrated model makes up for something that was not found: it leaves more than chance, and records
    do not exclude the rig file's numbers, by the `errors` of each stage.
    """
    beyond = any(check.id in ("residual_size", "held_out") and not check.ok for check in judged.checks)
    nominal, calibrated = (errors.get(stage, np.nan) for stage in STAGES[:2])
    excluded = nominal > SET.refuted_unknown * calibrated
    return judged.verdict == "unknown" and not found.effects and beyond and not excluded


def refuted(verdict: str, errors: Mapping[str, float], not_to_lead: Collection[str], unit: str) -> dict[str, str]:
    """The stages whose error is far above the least of those that may lead, and those without named effects."""
    least = min((error for stage, error in errors.items() if stage not in not_to_lead), default=0.0)
    factor = SET.refuted_unknown if verdict == "unknown" else SET.refuted
    return {
        stage: TEXT("refuted", error=Quantity(error, unit), least=Quantity(least, unit))
        for stage, error in errors.items()
        if error > factor * least or (verdict == "named" and stage != STAGES[-1])
    }
