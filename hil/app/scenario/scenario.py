"""SCENARIO.toml of a closed loop: true plant, instruments, reference, and the controller's belief."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final, Self

from controller.drives import DRIVES
from controller.limits import Limits
from controller.reference import Trajectory
from controller.registry import CONTROLLERS, ESTIMATORS, leads
from hil.app.scenario.checks import TrackChecks, read_checks
from hil.app.scenario.model_use import OfferTable
from hil.app.scenario.reference import read_reference, with_reference
from models.effects import Catalogue
from models.files.toml import check_tables, check_word, converted, in_file, read_toml
from models.laws.geometry import Capsule, Tissue
from models.rigs.kinds import KINDS
from models.rigs.reader import parse_rig, table_names
from models.rigs.rig import Rig
from models.rigs.schema import Among, NamedTable, from_table, key
from models.surfaces.surface import Plate
from plant.experiments.scenario import parse_truth
from plant.rig import STEP_S, Plant, Truth
from plant.sensing import Instrument
from plant.session import FEEDBACK, LOCALISATION, Instruments

Table = Mapping[str, Any]
TRUTH_TABLES: Final = ("scenario", "capsule", "tissue", "rig", "drive", "surface", "anatomy", "effects")
OWN_TABLES: Final = ("reference", "belief", "control", "limits", "localisation", "feedback", "checks", "offer")
TABLES: Final = TRUTH_TABLES + OWN_TABLES
BUS_TABLES: Final = ("bus", "faults", "plant", "operator", "jog", "learning")  # Further tables of a scenario on the bus
SAMPLE_STEPS: Final = 10  # Steps of the plant between samples of the truth (`plant.session`)
_CAPSULE: Final = asdict(Capsule())
_TISSUE: Final = {"preset": "jejunum", **asdict(Tissue())}
_PLATE: Final = Plate(0.0)


Estimator = Annotated[str, Among(ESTIMATORS)]
ESTIMATOR: Final = (
    "`default` fits the controller; `ukf` is filterpy's unscented Kalman filter for comparison, ten times as costly"
)
PROBE: Final = (
    "whether a short motion to and fro (5 mm behind a magnet, else 3 mm) first shows that the capsule follows the"
    " drive; not with setpoints of an operator; over a simulated bus the reference then begins at the capsule"
)


class Control(NamedTable):
    """`[control]` of a scenario; the default controller depends on the rig."""

    where = "control"
    tick_s: float = key("period of the control loop", 1e-3, 1e-4, 0.02)
    controller: str = key("name of the controller", "feedforward")
    judged_from_s: float = key("time from which tracking errors count", 0.5, 0.0)
    estimator: Estimator = key(ESTIMATOR, "default")
    probe: bool = key(PROBE, False)


@dataclass(frozen=True)
class TrackScenario:
    """A closed loop: `truth` and `instruments` of the plant; `belief` is all that the controller knows."""

    name: str
    duration_s: float
    seed: int
    kind: str
    truth: Truth
    instruments: Instruments
    belief: Rig
    reference: Trajectory
    limits: Limits
    control: Control
    checks: Mapping[str, TrackChecks] = field(default_factory=dict)
    offer: OfferTable | None = None

    def knowing(self, effects: Catalogue) -> Self:
        return replace(self, belief=effects.given_to(self.belief))


def load_track_scenario(path: Path, reference: Path | None = None) -> TrackScenario:
    """Read and check a scenario file, with the reference of another one where given. Raises ValueError."""
    raw, _ = read_toml(path, "scenario")
    raw = with_reference(raw, reference, "scenario")
    with in_file(path):
        return parse_track_scenario(raw)


def parse_track_scenario(raw: Table) -> TrackScenario:
    """A closed loop from parsed TOML. Errors as `load_track_scenario`."""
    if own := next((name for name in raw if name in BUS_TABLES), None):
        raise ValueError(f"tables must be those of a loop without a bus; got [{own}], which `capsule sil` reads")
    check_tables(raw, TABLES)
    seed = raw.get("anatomy", {}).get("seed", 0)
    if converted(seed, int, "anatomy.seed") < 0:
        raise ValueError(f"anatomy.seed must be zero or more; got {seed}")
    run, kind, truth = parse_truth({name: table for name, table in raw.items() if name in TRUTH_TABLES})
    if kind not in DRIVES:
        raise ValueError(f"rig.kind must be one of {', '.join(DRIVES)} to be controlled; got {kind!r}")
    surface = raw.get("surface", {}).get("kind", "gut")
    if surface == "air":
        raise ValueError("surface.kind must be 'gut' or 'plate' for a rig to be controlled; got 'air'")
    if run.seed < 0:
        raise ValueError(f"scenario.seed must be zero or more; got {run.seed}")
    _buildable(truth, raw)
    control = _control(raw.get("control", {}), kind, run.duration_s, run.step_s)
    limits = from_table(Limits, raw.get("limits", {}), "limits")
    instruments = Instruments(
        _instrument(raw.get("localisation", {}), "localisation", LOCALISATION, run.duration_s),
        _instrument(raw.get("feedback", {}), "feedback", FEEDBACK, run.duration_s),
    )
    reference = read_reference(raw.get("reference", {}), run.duration_s, limits)
    return TrackScenario(
        name=run.name or "unnamed",
        duration_s=run.duration_s,
        seed=run.seed,
        kind=kind,
        truth=truth,
        instruments=instruments,
        belief=read_belief(raw.get("belief", {}), kind, surface, raw.get("rig", {}).get("magnet")),
        reference=reference,
        limits=limits,
        control=control,
        checks=read_checks(raw.get("checks", {}), kind, reference, instruments, control.judged_from_s, run.duration_s),
        offer=OfferTable.read(raw) if "offer" in raw else None,
    )


def read_belief(table: Table, kind: str, surface: str, magnets: Table | None = None) -> Rig:
    """The rig file of the experimenter: `[belief.*]` over nominal values. Raises ValueError."""
    for name, content in table.items():
        check_word(name, "table of [belief]", table_names())
        if not isinstance(content, Mapping):
            raise ValueError(f"belief.{name} must be a table; got {content!r}")
    if "noise" in table:
        raise ValueError("belief must have no table [belief.noise], as the drive sets the noise of the filter")
    own = KINDS[kind]
    stated = table.get("rig", {}).get("magnet", None if "magnet_range_m" in table.get("rig", {}) else magnets)
    nominal: dict[str, Table] = {**own.nominal, "capsule": {**_CAPSULE, **own.nominal.get("capsule", {})}}
    nominal["rig"] = {"kind": kind, **(own.nominal.get("rig", {}) if stated is None else {"magnet": stated})}
    if surface == "gut":
        nominal["tissue"] = _TISSUE
    else:
        nominal["surface"] = {"kind": "plate", "friction_coefficient": _PLATE.friction_coefficient}
    if surface == "gut" and "surface" in own.tables:
        nominal["surface"] = {"kind": "gut"}
    if "lumen_diameter_m" in table.get("tissue", {}) and "tissue" in nominal:
        nominal["tissue"] = {key: value for key, value in nominal["tissue"].items() if key != "contact_angle_deg"}
    merged = {name: {**nominal.get(name, {}), **table.get(name, {})} for name in {**nominal, **table}}
    if merged["rig"]["kind"] != kind:
        raise ValueError(f"belief.rig.kind must be the plant's, {kind!r}; got {merged['rig']['kind']!r}")
    return parse_rig(merged, "belief")


def _buildable(truth: Truth, raw: Table) -> None:
    """Build the plant once, so that its errors name the table of the file in which the number stands."""
    for where, record in (("capsule", truth.capsule), ("tissue", truth.tissue)):
        for name, value in vars(record).items():
            if isinstance(value, str):
                continue
            may_be_zero = name in ("friction_coefficient", "nose_force_angle_deg")
            if not (value > 0 or (may_be_zero and value == 0)):
                least = "zero or more" if may_be_zero else "positive"
                raise ValueError(f"{where}.{name} must be {least}; got {value:g}")
    try:
        Plant(truth)
    except ValueError as error:
        table, _, rest = str(error).partition(".")
        key = rest.split(" ")[0]
        elsewhere = table == "drive" and key not in raw.get("drive", {}) and key in raw.get("rig", {})
        raise ValueError(f"rig.{rest}" if elsewhere else str(error)) from None


def _control(table: Table, kind: str, duration_s: float, step_s: float) -> Control:
    control = Control.read({"control": {"controller": DRIVES[kind].leading, **table}})
    name, able = control.controller, [name for name in CONTROLLERS if kind in leads(name)]
    check_word(name, f"control.controller of a {kind} rig", able)
    ratio, ticks = control.tick_s / step_s, round(duration_s / control.tick_s)
    if abs(ratio - round(ratio)) > 1e-6:
        raise ValueError(f"control.tick_s must be a multiple of the plant's step {step_s:g} s; got {control.tick_s:g}")
    if ticks < 1:
        raise ValueError(f"scenario.duration_s must be a tick of {control.tick_s:g} s or more; got {duration_s:g}")
    latest = ticks * control.tick_s - 2 * SAMPLE_STEPS * step_s
    if control.judged_from_s > latest + 1e-9:
        raise ValueError(
            f"control.judged_from_s must leave two samples of the truth to judge, so be at most {latest:g} s in a run"
            f" of {duration_s:g} s; got {control.judged_from_s:g}"
        )
    return control


def _instrument(table: Table, where: str, nominal: Instrument, duration_s: float) -> Instrument:
    plain = ((name, list(value) if isinstance(value, tuple) else value) for name, value in vars(nominal).items())
    given = {**dict(plain), **table}
    try:
        instrument = from_table(Instrument, given, where)
    except ValueError as error:
        raise ValueError(str(error).replace("instrument ", f"{where}.", 1)) from None
    fastest = 1 / (SAMPLE_STEPS * STEP_S)
    if "rate_Hz" in table and not 1 / duration_s <= instrument.rate_Hz <= fastest:
        raise ValueError(
            f"{where}.rate_Hz must lie in [{1 / duration_s:g}, {fastest:g}], two readings within the run or more and no"
            f" more than there are samples of the truth; got {instrument.rate_Hz:g}"
        )
    for name in ("gaps_s", "nan_s"):
        spans = getattr(instrument, name)
        if any(start < 0 for start in spans[::2]) or any(not length > 0 for length in spans[1::2]):
            raise ValueError(
                f"{where}.{name} must be pairs of a start from 0 on and a positive length; got {list(spans)[:8]}"
            )
    return instrument
