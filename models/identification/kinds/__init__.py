"""The kinds of rig that can be identified."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Final, cast

from models.assembly.model import effect_parameters
from models.checks.usable import cleaned, treated
from models.effects import REFINEMENTS
from models.identification.kind import Kind
from models.identification.kinds.axis.axis import AxisKind
from models.identification.kinds.axis.driven import DrivenAxisKind, NoisyAxisKind
from models.identification.kinds.axis.zero_phase import evened
from models.identification.kinds.dma import DmaKind
from models.identification.kinds.friction import FrictionKind
from models.identification.kinds.periods import PeriodsKind
from models.identification.kinds.reports import AnyKind
from models.identification.kinds.series.series import SeriesKind
from models.identification.kinds.vibro_table import VibroTableKind
from models.parameter import Name, Parameter, nearest
from models.records.record import USED, Record, named
from models.rigs.benches import AXIS, DRIVEN_AXIS
from models.rigs.rig import Rig
from models.theta import Theta

Known = Mapping[Name, tuple[float, float]]
"""Values by name, each with its standard deviation: of base parameters, and of effects that a model has already."""
NOTHING_KNOWN: Final[Known] = MappingProxyType({})
_BY_NAME: Final[Mapping[str, type[AnyKind]]] = {
    kind.name: kind for kind in (AxisKind, DmaKind, FrictionKind, PeriodsKind, VibroTableKind)
} | {DRIVEN_AXIS.id: DrivenAxisKind}


def kind_for(rig: Rig, records: Sequence[Record], known: Known = NOTHING_KNOWN) -> AnyKind:
    """The kind that a rig file describes; noise and the sign of a table's velocities come from `records`. Base
    parameters that are `known` replace the rig file's, and known effects belong to the base: they are fitted with it
    and are no candidates. The standard deviations under `[prior]` hold the calibration to the nominal values; raises
    ValueError for one of another name.
    """
    if rig.differing:
        plain = kind_for(replace(rig, differing={}), records, known)
        own = {name: kind_for(other, records, known) for name, other in rig.differing.items()}
        return cast(AnyKind, differing(plain, own))
    kind = _BY_NAME.get(records[0].kind if records else rig.kind, SeriesKind).from_rig(rig, records)
    if isinstance(kind, AxisKind):
        kind = NoisyAxisKind.where_shaken(kind, rig, records)
    fitted = [p.name for p in kind.base if p.fit]
    strange = next((name for name in rig.prior if name not in fitted), None)
    if strange is not None:
        raise ValueError(
            f"[prior] must name what calibration fits on a {rig.kind} rig, each with '_std'; got {strange + '_std'!r};"
            f" {nearest(strange, fitted)}"
        )
    if not (rig.prior or known):
        return kind
    base = tuple(_with_prior(p, rig.prior.get(p.name, p.spread), known.get(p.name)) for p in kind.base)
    ids = {name[0] for name in known if not isinstance(name, str)}
    in_base = [e for e in (*kind.effects, *REFINEMENTS) if e.id in ids]
    more = tuple(_with_prior(p, p.spread, known.get(p.key)) for p in effect_parameters(in_base))
    return replace(kind, base=(*base, *more), effects=tuple(e for e in kind.effects if e not in in_base))


def _with_prior(p: Parameter, spread: float, known: tuple[float, float] | None) -> Parameter:
    """`p` with the stated `spread`, or with the `known` value (within the bounds) and spread."""
    value, spread = (p.value, spread) if known is None else known
    return replace(p, value=min(max(value, p.lower), p.upper), spread=spread)


def ready(record: Record, rig: Rig) -> Record:
    """`record` for its kind: samples that the sensor missed filled in, a stage's at even times; once."""
    with named(record):
        clean = cleaned(record, rig)
        even = evened(clean, (*clean.layout.known(), USED)) if record.kind == AXIS.id else clean
        if even is clean:
            return clean
        return treated(replace(even, treated=clean.treated), "resampled", n=len(clean))


_BY_RECORD: Final = ("predict", "predictions", "residual", "stacked", "imitate", "extra_force", "of_force")


def differing(kind: Kind, own: Mapping[str, Kind]) -> Kind:
    """`kind` with its `own` kind for the records of some names; differences of nominal values that are fitted stay."""
    nominal = kind.nominal()
    shifts = {
        name: {key: value - nominal[key] for key, value in other.nominal().items() if value != nominal[key]}
        for name, other in own.items()
    }

    def shifted(theta: Any, by: Mapping[Any, float]) -> Any:
        if not isinstance(theta, Theta):
            return [shifted(one, by) for one in theta]
        return theta | {key: theta[key] + change for key, change in by.items()}

    def method(name: str) -> Callable[..., Any]:
        def called(self: Kind, record: Record, theta: Theta | Sequence[Theta], *rest: Any) -> Any:
            of = record.name.rpartition("/")[2]
            if of in own:
                return getattr(own[of], name)(record, shifted(theta, shifts[of]), *rest)
            return getattr(super(made, self), name)(record, theta, *rest)

        return called

    made: type[Any] = type(type(kind).__name__, (type(kind),), {name: method(name) for name in _BY_RECORD})
    same: Kind = object.__new__(made)
    for name, value in vars(kind).items():
        object.__setattr__(same, name, value)
    return same
