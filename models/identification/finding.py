"""The result of a closed loop as plain records: everything the report shows and nothing it has to compute."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from models.checks.finding import RecordFinding
from models.effects import CATALOGUE
from models.effects.effect import Effect
from models.formula import Line
from models.identification.kind import Array

Alike = Mapping[str, tuple[str, ...]]
"""By an effect that was found, those that the records do not separate from it."""
STAGES = ("nominal", "calibrated", "augmented")
NEXT_TOML, NEXT_CSV = "next_experiment.toml", "next_experiment.csv"
"""The files of a proposal: a reference for a controller, and the motion itself."""


@dataclass(frozen=True)
class Fitted:
    """A fitted number with its 95 % interval; `identifiable` is False where the data do not determine it."""

    value: float
    ci95: tuple[float, float]
    unit: str = "1"
    identifiable: bool = True


@dataclass(frozen=True)
class FoundEffect:
    """An effect that was added, with the effects that the data do not separate from it (`equivalent`). `curves` are the
    parameters of the refinements of its shape, by id. `confidence` is the search's `score` as a probability, where it
    is `calibrated`; `meaning` says it in words.
    """

    id: str
    equivalent: tuple[str, ...]
    parameters: dict[str, Fitted]
    evidence: float
    confidence: float
    curves: dict[str, dict[str, Fitted]] = field(default_factory=dict)
    score: float = float("nan")
    calibrated: bool = False
    meaning: str = ""


@dataclass(frozen=True)
class CandidateRow:
    """A candidate of a round: share of the residual when screened, validation gain when fitted, what became of it."""

    id: str
    round: int
    screened: float
    gain: float | None
    note: str


@dataclass(frozen=True)
class Check:
    """A check with its limit; `id` for programs, `name` and `meaning` for people."""

    id: str
    name: str
    value: float
    limit: float
    ok: bool
    meaning: str


@dataclass(frozen=True)
class Trace:
    """A record as a report draws it: abscissa, measurement, stages' predictions, `signals` to plot residuals over, and
    how it was `treated` before anything was fitted.
    """

    name: str
    role: str
    axis: str
    abscissa: Array
    measured: Array
    predicted: dict[str, Array]
    signals: dict[str, Array] = field(default_factory=dict)
    treated: tuple[str, ...] = ()


@dataclass(frozen=True)
class Column:
    """A further measured column: what its error is, in which unit, the errors by part and stage, the noise floor."""

    measure: str
    error_unit: str
    error: dict[str, dict[str, float]]
    noise_floor: float


@dataclass(frozen=True)
class Separation:
    """Standard deviations by which a proposed record, and the `best_record` so far, separate `rival` from `effect`."""

    effect: str
    rival: str
    standard_deviations: float
    best_record: str
    so_far: float


@dataclass(frozen=True)
class Proposal:
    """A motion for the next record: waypoints `times_s` (n,) in s and `places_m` (n,) in m of the driven `column`, or
    of the capsule where no path is imposed; the drive as columns of a record, what it would separate, and the ids of
    effects that it would show and the records so far cannot.
    """

    column: str
    times_s: Array
    places_m: Array
    motion: dict[str, Array]
    separations: tuple[Separation, ...]
    shows: tuple[str, ...] = ()


@dataclass(frozen=True)
class ResidualCurve:
    """The residual over one `variable`: local means `values` (n,) at `centres` (n,) with their 95 % intervals from
    `low` to `high`. `along`: as the residual stands, "+x", or against the motion, "-v". `share` of the residual that
    the curve predicts on stretches that it was not made on.
    """

    variable: str
    along: str
    share: float
    centres: Array
    values: Array
    low: Array
    high: Array

    @property
    def sized(self) -> bool:
        """Whether it is over the absolute variable: a resistance over a speed or a gap, which have a sign."""
        return self.along == "-v" and self.variable.startswith(("v_", "gap"))


@dataclass(frozen=True)
class ResidualSurface:
    """A curve over two `variables`: `values` (n, m) at `centres`, `half` their 95 % interval; NaN: never there."""

    variables: tuple[str, str]
    along: str
    share: float
    centres: tuple[Array, Array]
    values: Array
    half: Array


@dataclass(frozen=True)
class Term:
    """A term that follows a curve: `amplitude (offset + shape)`, the function `form` of `models.effects.shapes` over
    `variable` (`sized`: over its size) with the fitted `numbers` and those that are `given`; `level` is the resistance
    that it is compared with where it acts against the motion (`along` "-v"). `constant` is amplitude times offset,
    `text` all of it as a formula with its numbers, `left`
    the share of the curve's variance beyond its own uncertainty that it does not follow.
    """

    variable: str
    along: str
    sized: bool
    form: str
    text: str
    amplitude: Fitted
    constant: Fitted
    offset: float
    numbers: dict[str, Fitted]
    given: dict[str, float | tuple[float, ...]]
    level: float
    left: float


@dataclass(frozen=True)
class Tone:
    """A line in the spectrum of the residual that all records have."""

    frequency_Hz: float
    share: float


@dataclass(frozen=True)
class Dependence:
    """The residual of the training `records` and what it depends on: `quantity` in `unit`, the `curves`, the one
    that predicts most first, a `surface` where two variables predict clearly more, a `tone`, and the proposed `term`.
    `level` is the mean force that moves the body, 0 where the residual is no force. `inside`: the validation cost
    without and with the spline that the term follows; None where it follows a curve.
    """

    quantity: str
    unit: str
    records: tuple[str, ...]
    curves: tuple[ResidualCurve, ...]
    surface: ResidualSurface | None = None
    tone: Tone | None = None
    term: Term | None = None
    level: float = 0.0
    inside: tuple[float, float] | None = None


@dataclass(frozen=True)
class Profile:
    """The profile likelihood of the parameter `name`, fitted at `value`: by how much the log-likelihood drops (`drops`)
    at `values` where the others are fitted again. An end is `unshown` ("lower", "upper") where the drop is below that
    of a 95 % interval up to the bound.
    """

    name: str
    value: float
    unit: str
    values: tuple[float, ...]
    drops: tuple[float, ...]
    unshown: tuple[str, ...] = ()


@dataclass(frozen=True)
class Disagreement:
    """A training `record` with which others disagree: a parameter, or an amplitude, `by` is off by `shift`."""

    record: str
    by: str
    shift: float
    ci95: tuple[float, float]
    unit: str
    standard_deviations: float


@dataclass(frozen=True)
class Finding:
    """The whole answer of `close-loop`:

    - `verdict`: "named", "none" or "unknown"; `reasons`: why, a sentence each; `checks`: value, limit and result of
      each check behind it; `statements`: what must be said beside it.
    - `effects`: what the model lacked, each with parameters, 95 % intervals, confidence and the effects that these
      records cannot separate from it (`equivalent`); `candidates`: every effect that was tried, best first;
      `declared`: the effects by id, those that were tried as this kind has them.
    - `calibration`: each fitted base parameter with its interval; `nominal`: the rig file's values of them.
    - `error[part][stage]`: the error of the free run of the part "train" or "holdout" at the stage "nominal",
      "calibrated" or "augmented", by `measure` (a sentence) in `error_unit`, which is empty for a pure number;
      `noise_floor`: what noise alone leaves of it; `constant`: the error of the best constant, by part; `beside`: the
      same of each further measured column.
    - `kind` of the rig; `quantity` and `unit`: the measured column; `columns`: all measured ones; `traces`: each record
      as measured and as each stage predicts it.
    - `findings` on the records; `cannot_show`: why they cannot show an effect, by id; `smallest_detectable`: the least
      amplitude of each other effect that would have been found; `disagreeing`: the training records that do not agree
      with the others.
    - `next_experiment`: what to record next, a sentence, and its motion, `proposal`; None where nothing is open.
    - `dependence`: what the residual depends on after "unknown", with the proposed term.
    - `equations` with numbers, `symbolic` with the names of the fitted parameters; `profiles`: the likelihood of each.
    - `leading`: which stages may lead a controller; `stopped`: why no further effect was sought; `left_out`: what the
      search did without; `seconds` in all and by step, `timings`.
    """

    kind: str
    quantity: str
    unit: str
    measure: str
    columns: tuple[str, ...]
    error_unit: str
    verdict: str
    effects: tuple[FoundEffect, ...]
    calibration: dict[str, Fitted]
    nominal: dict[str, float]
    error: dict[str, dict[str, float]]
    noise_floor: float
    checks: tuple[Check, ...]
    candidates: tuple[CandidateRow, ...]
    smallest_detectable: dict[str, float]
    next_experiment: str | None
    statements: tuple[str, ...]
    equations: tuple[Line, ...]
    traces: tuple[Trace, ...]
    seconds: float
    timings: dict[str, float]
    findings: tuple[RecordFinding, ...] = ()
    cannot_show: dict[str, str] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    proposal: Proposal | None = None
    symbolic: tuple[Line, ...] = ()
    dependence: Dependence | None = None
    declared: Mapping[str, type[Effect]] = field(default_factory=dict)
    leading: tuple[str, ...] = ()
    stopped: str = "noise"
    disagreeing: tuple[Disagreement, ...] = ()
    profiles: tuple[Profile, ...] = ()
    constant: Mapping[str, float] = field(default_factory=dict)
    beside: Mapping[str, Column] = field(default_factory=dict)
    left_out: str = ""

    @property
    def by_column(self) -> list[Finding]:
        """The same with the errors of each measured column in turn."""
        return [self, *(replace(self, quantity=name, **vars(column)) for name, column in self.beside.items())]

    def effect(self, name: str) -> type[Effect] | None:
        """The effect `name` as this kind has it, else as the catalogue does; None where neither knows it."""
        return self.declared.get(name) or CATALOGUE.get(name)
