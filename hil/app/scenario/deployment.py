"""RIG.toml of a deployment: the rig file's tables, and those that say which bus, which controller, where to go and
within what limits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import can

from controller.limits import Limits
from controller.model.control_model import ControlModel, control_model
from controller.registry import CONTROLLERS, checked_estimator, leads
from controller.supervision.acceptance import AcceptanceTest, Verdict
from controller.trajectory import Trajectory
from hil.app.scenario.learning import Pace, read_pace
from hil.app.scenario.model_offer import Offered, offer_of, read_offer, read_offer_table
from hil.app.scenario.reference import read_reference, with_reference
from hil.bus.catalogue import load_catalogue
from hil.nodes.actuators import ACTUATORS, ActuatorTable, needs_fd, read_actuator
from hil.nodes.controller.guard import FEEDBACK_S
from hil.nodes.controller.node import Task
from hil.nodes.controller.operator import OperatorLimits
from hil.nodes.frame_map import FRAME_MAPS, frame_map_of
from models.files.rig import TABLES, Rig, parse_rig
from models.files.tables import check_ranges, from_table
from models.files.toml import parse_toml, read_toml, toml_text
from models.identification.finding import STAGES
from models.identification.model import read_model, read_report
from models.parameter import nearest
from models.theta import Theta

PLANNING: Final = 0.4
"""Share of a tick within which a plan has to be made. At 1 kHz listening, estimate, limits and sending take a quarter
of it.
"""
OWN_TABLES: Final = (
    "bus", *ACTUATORS, "control", "reference", "limits", "model", "offer", "operator", "learning", "plant",
)  # fmt: skip


@dataclass(frozen=True)
class BusTable:
    """`[bus]`: a python-can interface, its channel and the bit rate, which must be the catalogue's. `fd` opens it for
    CAN FD, whose data go at `data_bitrate`; the sample points are shares of a bit. With `key_file`, relative to the
    deployment file, every frame is authenticated.
    """

    interface: str
    channel: str | int = ""
    bitrate: int = 1_000_000
    fd: bool = False
    data_bitrate: int = 5_000_000
    sample_point: float = 0.667
    data_sample_point: float = 0.667
    key_file: str = ""

    def __post_init__(self) -> None:
        rate = load_catalogue().bit_rate
        if self.bitrate != rate:
            raise ValueError(f"bus.bitrate must be {rate}, as capsule.dbc has it; got {self.bitrate}")
        check_ranges(self, "bus", BUS_RANGES)
        check_key(self.key_file, self.fd)
        if self.fd:
            self.timing()

    def timing(self) -> can.BitTimingFd:
        """The bit timing of CAN FD by a clock of 80 MHz. Raises ValueError where that cannot make it."""
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


BUS_RANGES: Final = (
    ("data_bitrate", 1_000_000, 8_000_000),
    ("sample_point", 0.5, 0.9),
    ("data_sample_point", 0.5, 0.9),
)
NEAR_POINT: Final = 0.05
"""By how much a sample point may be off what is asked for."""


@dataclass(frozen=True)
class ControlTable:
    """`[control]`: which controller at which tick, the noise of the localisation and its pixels or steps, how long from
    the drive's being enabled on, and how long to wait for that; `priority` 1 to 99 asks for SCHED_FIFO, `core` from 0
    on for one core alone. Unless `probe` is false a short motion to and fro comes before the reference.
    """

    controller: str = "feedforward"
    tick_s: float = 2e-3
    seen_noise_m: float = 5e-4
    resolution_m: float = 0.0
    duration_s: float = 10.0
    give_up_s: float = 5.0
    priority: int = 0
    core: int = -1
    estimator: str = "default"
    probe: bool = True

    def __post_init__(self) -> None:
        ranges = (
            ("tick_s", 5e-4, 0.02),
            ("seen_noise_m", 0.0, 0.01),
            ("resolution_m", 0.0, 0.01),
            ("duration_s", 0.01, 86400.0),
            ("give_up_s", 0.5, 3600.0),
        )
        check_ranges(self, "control", ranges)
        if not 0 <= self.priority <= 99:
            raise ValueError(f"control.priority must lie in [0, 99]; got {self.priority}")
        if self.core < -1:
            raise ValueError(f"control.core must be a core's number, or -1 for any; got {self.core}")
        checked_estimator(self.estimator)
        if self.controller not in CONTROLLERS:
            choices = f"one of {', '.join(CONTROLLERS)}"
            raise ValueError(
                f"control.controller must be {choices}; got {self.controller!r};"
                f" {nearest(self.controller, CONTROLLERS)}"
            )


@dataclass(frozen=True)
class ModelTable:
    """`[model]`: a file that close-loop wrote and its report.json, paths relative to the rig file."""

    file: str
    report: str
    stage: str = "augmented"

    def __post_init__(self) -> None:
        if self.stage not in STAGES:
            raise ValueError(
                f"model.stage must be one of {', '.join(STAGES)}; got {self.stage!r}; {nearest(self.stage, STAGES)}"
            )


@dataclass(frozen=True)
class PlantTable:
    """`[plant]`: the scenario, relative to the file, whose plant `capsule plant` simulates where no rig is at hand, and
    the real-time priority that it asks for. The controller never reads that scenario.
    """

    scenario: str
    priority: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.priority <= 99:
            raise ValueError(f"plant.priority must lie in [0, 99]; got {self.priority}")


@dataclass(frozen=True)
class DeployedPlant:
    """The drive side that a deployment file names: a scenario's plant on a bus; `drive` where it is another maker's."""

    scenario: Path
    bus: BusTable
    priority: int = 0
    drive: ActuatorTable | None = None


@dataclass(frozen=True)
class Deployment:
    """A controller to run on a bus. `values` are the learned model's parameters, none where nominal; `verdict` the
    gate's, where asked; `drive` the carriage's settings where it is another maker's; `operator` what setpoints
    from the bus are held to, `pace` that of a run that learns.
    """

    name: str
    text: str
    rig: Rig
    bus: BusTable
    control: ControlTable
    reference: Trajectory
    limits: Limits
    values: Theta
    verdict: Verdict | None = None
    drive: ActuatorTable | None = None
    offered: Offered | None = None
    operator: OperatorLimits = OperatorLimits()
    pace: Pace = Pace()

    def task(self) -> Task:
        """What the controller node is built from. Raises ValueError for a rig that cannot be controlled."""
        control, offer = self.control, offer_of(self.offered, self.believed)
        told = (self.reference, self.limits, control.seen_noise_m, PLANNING * control.tick_s)
        return Task(
            self.believed(self.values),
            control.controller,
            *told,
            resolution_m=control.resolution_m,
            offer=offer,
            estimator=control.estimator,
            operator=self.operator if self.operator.accept else None,
            probe=control.probe and not self.operator.accept,
        )

    def believed(self, values: Theta) -> ControlModel:
        """The control model of its rig with the `values` of a model's parameters. Raises ValueError for a rig that
        cannot be controlled.
        """
        return control_model(self.rig, values, self.control.tick_s)


def load_deployment(path: Path, reference: Path | None = None) -> Deployment:
    """Read and check a deployment file, with the reference of another one where that is given; anything wrong is a
    ValueError of one sentence.
    """
    raw, text = read_toml(path, "rig file")
    if reference is not None:
        raw = with_reference(raw, reference, "control")
        text = toml_text(raw)
    try:
        values, verdict = _learned(raw, path.parent)
        deployment = parse_deployment(text, values, path.stem, verdict)
        return replace(deployment, offered=read_offer(read_offer_table(raw), path.parent, deployment.rig, values))
    except ValueError as error:
        raise ValueError(str(error) if str(error).startswith(str(path.parent)) else f"{path}: {error}") from None


def read_deployed_rig(path: Path) -> Rig:
    """The rig of a rig file or of a deployment file, whose own tables are left out. Raises ValueError of one
    sentence.
    """
    return _rig(read_toml(path, "rig file")[0], str(path))


def read_plant(path: Path) -> DeployedPlant:
    """The simulated plant that a deployment file names; ValueError of one sentence where it names none."""
    raw, _ = read_toml(path, "deployment file")
    try:
        _check_tables(raw)
        if "plant" not in raw:
            raise ValueError(
                "table [plant] must be there with the key 'scenario', whose plant is simulated; it is missing"
            )
        table = from_table(PlantTable, raw["plant"], "plant")
        bus = from_table(BusTable, raw.get("bus", {}), "bus")
        drive = _drive(raw, _rig(raw).kind, bus, from_table(Limits, raw.get("limits", {}), "limits"))
        return DeployedPlant(path.parent / table.scenario, bus, table.priority, drive)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_deployment(text: str, values: Theta, name: str = "rig", verdict: Verdict | None = None) -> Deployment:
    """A deployment from TOML text and the learned `values`. Errors as `load_deployment`."""
    raw = parse_toml(text, "rig file")
    _check_tables(raw)
    rig = _rig(raw)
    control = from_table(ControlTable, raw.get("control", {}), "control")
    if rig.kind in FRAME_MAPS and rig.kind not in leads(control.controller):
        raise ValueError(f"control.controller must be one that leads a {rig.kind} rig; got {control.controller!r}")
    limits = from_table(Limits, raw.get("limits", {}), "limits")
    if rig.kind in FRAME_MAPS:
        check_tick(control.tick_s, rig.kind, limits)
    bus = from_table(BusTable, raw.get("bus", {}), "bus")
    return Deployment(
        name,
        text,
        rig,
        bus,
        control,
        read_reference(raw.get("reference", {}), control.duration_s),
        limits,
        values,
        verdict,
        _drive(raw, rig.kind, bus, limits),
        operator=operator_limits(raw, limits),
        pace=read_pace(raw),
    )


def operator_limits(raw: Mapping[str, Any], limits: Limits) -> OperatorLimits:
    """`[operator]`: what setpoints of an operator are held to, within `limits`. Raises ValueError of one sentence."""
    operator = from_table(OperatorLimits, raw.get("operator", {}), "operator")
    operator.check_sources(load_catalogue())
    if not operator.accept:
        return operator
    fastest, farthest = min(limits.speed_m_s, limits.carriage_speed_m_s), limits.travel_m
    if operator.speed_m_s > fastest:
        raise ValueError(
            f"operator.speed_m_s must be at most {fastest:g}, as [limits] have it; got {operator.speed_m_s:g}"
        )
    for name in ("lowest_m", "highest_m"):
        if abs(getattr(operator, name)) > farthest:
            raise ValueError(
                f"operator.{name} must lie within limits.travel_m, {farthest:g} m; got {getattr(operator, name):g}"
            )
    return operator


def read_operator(path: Path) -> tuple[BusTable, OperatorLimits]:
    """The bus of the deployment file `path` and what setpoints are held to there; ValueError of one sentence where none
    are accepted.
    """
    raw, _ = read_toml(path, "deployment file")
    try:
        _check_tables(raw)
        operator = operator_limits(raw, from_table(Limits, raw.get("limits", {}), "limits"))
        if not operator.accept:
            raise ValueError("operator.accept must be true, or the controller takes no setpoints; got false")
        return from_table(BusTable, raw.get("bus", {}), "bus"), operator
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _check_tables(raw: Mapping[str, Any]) -> None:
    known = (*TABLES, *OWN_TABLES)
    for table, content in raw.items():
        if table not in known:
            raise ValueError(f"tables must be among {', '.join(known)}; got [{table}]; {nearest(table, known)}")
        if not isinstance(content, dict):
            raise ValueError(f"{table} must be a table; got {content!r}")
    if "plant" in raw:
        from_table(PlantTable, raw["plant"], "plant")


def check_tick(tick_s: float, kind: str, limits: Limits) -> None:
    """A tick must be shorter than a command lives and than the guard waits for feedback, or the drive is never led."""
    longest = min(1e-3 * frame_map_of(kind).life_ms(limits.carriage_speed_m_s), FEEDBACK_S[kind])
    if tick_s > longest + 1e-9:
        raise ValueError(
            f"control.tick_s must be at most {longest:g} s for a {kind} rig on the bus, else commands die between"
            f" ticks; got {tick_s:g}"
        )


def _drive(raw: Mapping[str, Any], kind: str, bus: BusTable, limits: Limits) -> ActuatorTable | None:
    """The drive that the file names, on a bus that carries its frames."""
    table = read_actuator(raw, kind, limits)
    check_no_key(table, bus.key_file)
    if needs_fd(table) and not bus.fd:
        raise ValueError("bus.fd must be true with [moteus], whose frames are CAN FD; got false")
    return table


def check_key(key_file: str, fd: bool) -> None:
    """Refuse a key on a classic bus. Raises ValueError."""
    if key_file and not fd:
        raise ValueError(
            "bus.fd must be true with bus.key_file: classic CAN has no room for an authenticator; got false"
        )


def check_no_key(drive: ActuatorTable | None, key_file: str) -> None:
    """Refuse a key beside another maker's drive. Raises ValueError."""
    if drive is not None and key_file:
        raise ValueError("bus.key_file must be left out with another maker's drive, which knows no such key; got one")


def _rig(raw: Mapping[str, Any], where: str = "rig file") -> Rig:
    return parse_rig({name: table for name, table in raw.items() if name not in OWN_TABLES}, where)


def _learned(raw: Mapping[str, Any], folder: Path) -> tuple[Theta, Verdict | None]:
    """Values of the model that the file names and what the gate says of them."""
    if not isinstance(raw.get("model"), dict):
        return Theta(), None
    table, rig = from_table(ModelTable, raw["model"], "model"), _rig(raw)
    model = read_model(folder / table.file, rig.kind)
    verdict = AcceptanceTest().judge(read_report(folder / table.report), model, rig, stage=table.stage)
    return model.believed(table.stage), verdict
