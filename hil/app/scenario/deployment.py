"""RIG.toml of a deployment: the tables of the rig file, and those of bus, controller, reference and limits."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final

import can
from pydantic import Field

from controller.limits import Limits
from controller.model.control_model import ControlModel, control_model
from controller.reference import Trajectory
from controller.registry import CONTROLLERS, leads
from controller.supervision.acceptance import Acceptance, judge
from hil.app.scenario.model_use import CHOSEN, ModelTable, Offered, OfferTable, offer_of, read_offer
from hil.app.scenario.reference import read_reference, with_reference
from hil.app.scenario.scenario import ESTIMATOR, PROBE, Estimator, check_tables
from hil.bus.catalogue import load_catalogue
from hil.drives.makers import ACTUATORS, read_actuator
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import FRAME_MAPS, frame_map_of
from hil.nodes.node import Task
from hil.nodes.operator import OperatorLimits
from models.effects import CATALOGUE, Catalogue
from models.files.toml import in_file, parse_toml, read_toml, toml_text
from models.identification.finding import STAGES
from models.identification.model import Model, read_model, read_report
from models.identification.validity import Ranges
from models.rigs.reader import parse_rig, table_names
from models.rigs.rig import Rig
from models.rigs.schema import Among, NamedTable, from_table, key
from models.theta import Theta

PLANNING: Final = 0.4
"""Share of a tick for the plan. At 1 kHz receiving, estimate, limits and sending take a quarter of a tick."""
OWN_TABLES: Final = (
    "bus", *ACTUATORS, "control", "reference", "limits", "model", "offer", "operator", "learning", "plant",
)  # fmt: skip


DataBitRate = Annotated[int, Field(ge=1_000_000, le=8_000_000)]
SamplePoint = Annotated[float, Field(ge=0.5, le=0.9)]
Priority = Annotated[int, Field(ge=0, le=99)]
KEY_FILE: Final = (
    "file with the key of authenticated frames, this user's alone (0600), relative to this one; needs `fd`"
)


class BusTable(NamedTable):
    """`[bus]`: a python-can interface."""

    where = "bus"
    interface: str = key("name of the python-can interface, such as `socketcan`, or `capsule_local` between processes")
    channel: str | int = key("its channel, such as `can0`", "")
    bitrate: int = key("bit rate, which must be that of `hil/capsule.dbc`", 1_000_000)
    fd: bool = key("opens the interface for CAN FD", False)
    data_bitrate: DataBitRate = key("bit rate of the data of CAN FD frames", 5_000_000)
    sample_point: SamplePoint = key("where a bit is sampled, as a share of it, with `fd`", 0.667)
    data_sample_point: SamplePoint = key("likewise a bit of the data", 0.667)
    key_file: str = key(KEY_FILE, "")

    def model_post_init(self, _: Any) -> None:
        rate = load_catalogue().bit_rate
        if self.bitrate != rate:
            raise ValueError(f"bus.bitrate must be {rate}, as capsule.dbc has it; got {self.bitrate}")
        check_key(self.key_file, self.fd)
        if self.fd:
            self.timing()

    def timing(self) -> can.BitTimingFd:
        """The bit timing of CAN FD with a clock of 80 MHz. Raises ValueError where that is not possible."""
        rates = f"{self.bitrate} and {self.data_bitrate} bit/s at {self.sample_point:g} and {self.data_sample_point:g}"
        try:
            found = can.BitTimingFd.from_sample_point(
                80_000_000, self.bitrate, 100 * self.sample_point, self.data_bitrate, 100 * self.data_sample_point
            )
        except ValueError as error:
            raise ValueError(f"bus.data_bitrate must be one that 80 MHz can make ({rates}); got: {error}") from None
        for name, made in (("sample_point", found.nom_sample_point), ("data_sample_point", found.data_sample_point)):
            if abs(made / 100 - getattr(self, name)) > NEAR_POINT:
                raise ValueError(
                    f"bus.{name} must be within {NEAR_POINT:g} of one that 80 MHz can make ({rates}); the nearest is"
                    f" {made / 100:.3f}"
                )
        return found


NEAR_POINT: Final = 0.05
"""Largest difference of a sample point from the one asked for."""


class ControlTable(NamedTable):
    """`[control]`: the controller, its tick, and how long it leads once the drive is enabled."""

    where = "control"
    controller: Annotated[str, Among(CONTROLLERS)] = key("name of the controller", "feedforward")
    tick_s: float = key("period of the control loop", 2e-3, 5e-4, 0.02)
    seen_noise_m: float = key("standard deviation of the localisation that the estimator expects", 5e-4, 0.0, 0.01)
    resolution_m: float = key(
        "pixels or steps of the localisation, 0 where they are finer than its noise", 0.0, 0.0, 0.01
    )
    duration_s: float = key("how long to run", 10.0, 0.01, 86400.0)
    give_up_s: float = key(
        "longest time until the drive is enabled, localisation included, before the run is given up", 5.0, 0.5, 3600.0
    )
    priority: Priority = key("1 to 99 asks for the real-time scheduler SCHED_FIFO, 0 does not", 0)
    core: int = key("processor core to run on, -1 for any", -1, -1, 4095)
    estimator: Estimator = key(ESTIMATOR, "default")
    probe: bool = key(PROBE, True)


class PlantTable(NamedTable):
    """`[plant]`: the scenario that `capsule plant` simulates in place of a rig; the controller never reads it."""

    where = "plant"
    scenario: str = key(
        "scenario whose plant `capsule plant` simulates, relative to this file; the controller never reads it"
    )
    priority: Priority = key("1 to 99 asks for the real-time scheduler SCHED_FIFO, 0 does not", 0)


class LearningTable(NamedTable):
    """`[learning]`; with an infinite `answer_s` no tick waits for the answer."""

    where = "learning"
    gathered_s: float = key(
        "seconds of measurements after the model broke that are identified, with `--learn`", 75.0, 10.0, 240.0
    )
    held_out_share: float = key("share at their end that is held out to judge the found model", 0.2, 0.1, 0.5)
    answer_s: float = key("how long simulated time waits for an answer; on a real bus nothing waits", 60.0, 1.0)
    trial_s: float = key("how long a new model is on trial", 60.0, 5.0, 600.0)
    worse: float = key(
        "the new model is taken back where its tracking error exceeds this many times that before", 1.0, 0.5, 2.0
    )
    experiment_mm: float = key(
        "how far an experiment that the search proposes may lead the capsule to either side of the resting reference;"
        " 0: none is driven",
        0.0,
        0.0,
        50.0,
    )
    experiment_mm_s: float = key(
        "speed of an experiment's strokes, some of which have half and twice of it", 2.0, 0.1, 50.0
    )
    experiment_s: float = key("longest duration of an experiment, without the return", 20.0, 4.0, 60.0)


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
    chosen.
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
        values, verdict, learned, covered = _learned(raw, path.parent, known)
        deployment = parse_deployment(text, values, path.stem, verdict)
        deployment = replace(deployment, rig=known.given_to(deployment.rig), learned=learned, covered=covered)
        return replace(
            deployment,
            offered=read_offer(OfferTable.read(raw) if "offer" in raw else None, path.parent, deployment.rig, values),
        )


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


def parse_deployment(text: str, values: Theta, name: str = "rig", verdict: Acceptance | None = None) -> Deployment:
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
    stated = (name, text, rig, bus, control, reference, limits, values, verdict, drive)
    return Deployment(*stated, operator=operator, learning=LearningTable.read(raw))


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
    for table, content in raw.items():
        if not isinstance(content, dict):
            raise ValueError(f"{table} must be a table; got {content!r}")
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
    """Another maker's drive that the file names, on a bus that carries its frames."""
    table = read_actuator(raw, kind, limits)
    check_no_key(table, bus.key_file)
    if table is not None and table.fd and not bus.fd:
        raise ValueError("bus.fd must be true with [moteus], whose frames are CAN FD; got false")
    return table


def check_key(key_file: str, fd: bool) -> None:
    """Refuse a key on a classic bus. Raises ValueError."""
    if key_file and not fd:
        raise ValueError("bus.fd must be true with bus.key_file, as an authenticator needs CAN FD; got false")


def check_no_key(drive: ActuatorTable | None, key_file: str) -> None:
    """Refuse a key beside another maker's drive. Raises ValueError."""
    if drive is not None and key_file:
        raise ValueError("bus.key_file must be left out with another maker's drive, which knows no such key; got one")


def _rig(raw: Mapping[str, Any]) -> Rig:
    return parse_rig({name: table for name, table in raw.items() if name not in OWN_TABLES}, "rig file")


def _learned(
    raw: Mapping[str, Any], folder: Path, known: Catalogue
) -> tuple[Theta, Acceptance | None, Model | None, Ranges]:
    """Values of the model that the file names, and their acceptance test; the model itself where a stage of it is to be
    chosen; the ranges that its records covered. Its last stage, and what the records do not separate from it, must pass
    that test to be chosen.
    """
    if not isinstance(raw.get("model"), dict):
        return Theta(), None, None, {}
    table, rig = ModelTable.read(raw), known.given_to(_rig(raw))
    model = read_model(folder / table.file, rig.kind, catalogue=known)
    stage = STAGES[-1] if table.stage == CHOSEN else table.stage
    verdict = judge(read_report(folder / table.report), model, rig, stage=stage)
    if table.stage != CHOSEN or not model.possible:
        return model.believed(stage), verdict, None, model.validity
    refused = {} if verdict.passed else dict.fromkeys((stage, *model.members), verdict.sentence)
    return model.believed(STAGES[0]), None, replace(model, barred={**refused, **model.barred}), model.validity
