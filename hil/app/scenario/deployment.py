"""RIG.toml of a deployment: the tables of the rig file, and those of bus, controller, reference and limits."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from controller.limits import Limits
from controller.model.control_model import ControlModel, control_model
from controller.reference import Trajectory
from controller.registry import leads
from controller.supervision.acceptance import Acceptance, judge
from hil.app.scenario.chosen import others_of
from hil.app.scenario.deployment_tables import BusTable, ControlTable, LearningTable, PlantTable, check_no_key
from hil.app.scenario.model_use import CHOSEN, ModelTable, Offered, OfferTable, offer_of, read_offer
from hil.app.scenario.reference import read_reference, with_reference
from hil.drives.makers import ACTUATORS, read_actuator
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import FRAME_MAPS, frame_map_of
from hil.nodes.operator import OperatorLimits
from hil.nodes.task import Task
from models.effects import CATALOGUE, Catalogue
from models.files.toml import check_tables, in_file, parse_toml, read_toml, toml_text
from models.identification.finding import STAGES
from models.identification.model import Model, read_model, read_report
from models.identification.validity import Ranges
from models.rigs.reader import parse_rig, table_names
from models.rigs.rig import Rig
from models.rigs.schema import from_table
from models.theta import Theta

PLANNING: Final = 0.4
"""Share of a tick for the plan. At 1 kHz receiving, estimate, limits and sending take a quarter of a tick."""
OWN_TABLES: Final = (
    "bus", *ACTUATORS, "control", "reference", "limits", "model", "offer", "operator", "learning", "plant",
)  # fmt: skip


@dataclass(frozen=True)
class DeployedPlant:
    """The simulated drive side of a deployment: a scenario's plant on a bus; `drive` where it is another maker's."""

    scenario: Path
    bus: BusTable
    priority: int = 0
    drive: ActuatorTable | None = None
    folder: Path = Path()


@dataclass(frozen=True)
class Deployment:
    """A controller to run on a bus: `values` of a learned model, the `verdict` of its acceptance test, another maker's
    `drive`, the limits of setpoints (`operator`), and the table `learning`. A stage of the model `learned` is to be
    chosen. `others` may lead on once that model is broken.
    """

    name: str
    text: str
    rig: Rig
    bus: BusTable
    control: ControlTable
    reference: Trajectory
    limits: Limits
    values: Theta
    verdict: Acceptance | None = None
    drive: ActuatorTable | None = None
    offered: Offered | None = None
    operator: OperatorLimits = OperatorLimits()
    learning: LearningTable = LearningTable()
    learned: Model | None = None
    others: Mapping[str, Theta] = field(default_factory=dict)
    covered: Ranges = field(default_factory=dict)

    def task(self) -> Task:
        """The task of the controller node. Raises ValueError for a rig that cannot be controlled."""
        control, offer = self.control, offer_of(self.offered, self.believed)
        return Task(
            self.believed(self.values),
            control.controller,
            self.reference,
            self.limits,
            control.seen_noise_m,
            PLANNING * control.tick_s,
            resolution_m=control.resolution_m,
            offer=offer,
            others={stage: self.believed(values) for stage, values in self.others.items()},
            estimator=control.estimator,
            operator=self.operator if self.operator.accept else None,
            probe=control.probe and not self.operator.accept,
        )

    def believed(self, values: Theta) -> ControlModel:
        """The control model with the `values` of a model; ValueError for a rig that cannot be controlled."""
        return control_model(self.rig, values, self.control.tick_s)


def load_deployment(path: Path, reference: Path | None = None, known: Catalogue = CATALOGUE) -> Deployment:
    """Read and check a deployment file, its rig with `known` effects. Raises ValueError of one sentence."""
    raw, text = read_toml(path, "rig file")
    if reference is not None:
        raw = with_reference(raw, reference, "control")
        text = toml_text(raw)
    with in_file(path):
        deployment = parse_deployment(text, Theta(), path.stem)
        deployment = replace(deployment, rig=known.given_to(deployment.rig), **_learned(raw, path.parent, known))
        table = OfferTable.read(raw) if "offer" in raw else None
        return replace(deployment, offered=read_offer(table, path.parent, deployment.rig, deployment.values))


def read_plant(path: Path) -> DeployedPlant:
    """The simulated plant that a deployment file names; ValueError of one sentence where it names none."""
    raw, _ = read_toml(path, "deployment file")
    with in_file(path):
        _check_tables(raw)
        if "plant" not in raw:
            raise ValueError("table [plant] must have the key 'scenario', the plant to simulate; it is missing")
        table = PlantTable.read(raw)
        bus = BusTable.read(raw)
        drive = _drive(raw, _rig(raw).kind, bus, from_table(Limits, raw.get("limits", {}), "limits"))
        return DeployedPlant(path.parent / table.scenario, bus, table.priority, drive, path.parent)


def parse_deployment(text: str, values: Theta, name: str = "rig") -> Deployment:
    """A deployment from TOML text and the learned `values`. Errors as `load_deployment`."""
    raw = parse_toml(text, "rig file")
    _check_tables(raw)
    rig = _rig(raw)
    control = ControlTable.read(raw)
    if rig.kind in FRAME_MAPS and rig.kind not in leads(control.controller):
        raise ValueError(f"control.controller must be one that leads a {rig.kind} rig; got {control.controller!r}")
    limits = from_table(Limits, raw.get("limits", {}), "limits")
    if rig.kind in FRAME_MAPS:
        check_tick(control.tick_s, rig.kind, limits)
    bus = BusTable.read(raw)
    reference = read_reference(raw.get("reference", {}), control.duration_s)
    drive, operator = _drive(raw, rig.kind, bus, limits), operator_limits(raw, limits)
    stated = (name, text, rig, bus, control, reference, limits, values)
    return Deployment(*stated, drive=drive, operator=operator, learning=LearningTable.read(raw))


def operator_limits(raw: Mapping[str, Any], limits: Limits) -> OperatorLimits:
    """`[operator]`: the limits of an operator's setpoints, within `limits`. Raises ValueError of one sentence."""
    operator = OperatorLimits.read(raw)
    operator.check_sources()
    if not operator.accept:
        return operator
    fastest, farthest = min(limits.speed_m_s, limits.carriage_speed_m_s), limits.travel_m
    if operator.speed_m_s > fastest:
        raise ValueError(f"operator.speed_m_s must be at most {fastest:g}, as in [limits]; got {operator.speed_m_s:g}")
    for name in ("lowest_m", "highest_m"):
        end = getattr(operator, name)
        if abs(end) > farthest:
            raise ValueError(f"operator.{name} must lie within limits.travel_m, {farthest:g} m; got {end:g}")
    return operator


def read_operator(path: Path) -> tuple[BusTable, OperatorLimits]:
    """The bus of a deployment file and the limits of setpoints; ValueError where none are accepted."""
    raw, _ = read_toml(path, "deployment file")
    with in_file(path):
        _check_tables(raw)
        operator = operator_limits(raw, from_table(Limits, raw.get("limits", {}), "limits"))
        if not operator.accept:
            raise ValueError("operator.accept must be true, or the controller takes no setpoints; got false")
        return BusTable.read(raw), operator


def _check_tables(raw: Mapping[str, Any]) -> None:
    check_tables(raw, (*table_names(), *OWN_TABLES))
    if "plant" in raw:
        PlantTable.read(raw)


def check_tick(tick_s: float, kind: str, limits: Limits) -> None:
    """A tick must be shorter than the life of a command and the timeout of feedback, or the drive is never led."""
    frame_map = frame_map_of(kind)
    longest = min(1e-3 * frame_map.life_ms(limits.carriage_speed_m_s), frame_map.feedback_s)
    if tick_s > longest + 1e-9:
        raise ValueError(
            f"control.tick_s must be at most {longest:g} s for a {kind} rig on the bus, else commands die between"
            f" ticks; got {tick_s:g}"
        )


def _drive(raw: Mapping[str, Any], kind: str, bus: BusTable, limits: Limits) -> ActuatorTable | None:
    table = read_actuator(raw, kind, limits)
    check_no_key(table, bus.key_file)
    if table is not None and table.fd and not bus.fd:
        raise ValueError("bus.fd must be true with [moteus], whose frames are CAN FD; got false")
    return table


def _rig(raw: Mapping[str, Any]) -> Rig:
    return parse_rig({name: table for name, table in raw.items() if name not in OWN_TABLES}, "rig file")


def _learned(raw: Mapping[str, Any], folder: Path, known: Catalogue) -> dict[str, Any]:
    """What the model that the file names gives a deployment. Where a stage of it is to be chosen, it is `learned`; its
    last stage, and what the records do not separate from it, must then pass the acceptance test to be chosen.
    """
    if not isinstance(raw.get("model"), dict):
        return {}
    table, rig = ModelTable.read(raw), known.given_to(_rig(raw))
    model = read_model(folder / table.file, rig.kind, catalogue=known)
    stage = STAGES[-1] if table.stage == CHOSEN else table.stage
    verdict = judge(read_report(folder / table.report), model, rig, stage=stage)
    if table.stage == CHOSEN and model.chooses:
        refused = {} if verdict.passed else dict.fromkeys((stage, *model.members), verdict.sentence)
        learned = replace(model, barred={**refused, **model.barred})
        return {"values": model.believed(STAGES[0]), "learned": learned, "covered": model.validity}
    values = model.believed(stage)
    others = others_of(model, values) if table.stage == CHOSEN else {}
    return {"values": values, "verdict": verdict, "others": others, "covered": model.validity}
