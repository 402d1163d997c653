"""SCENARIO.toml on the bus: a closed loop with bus, faults, operator, and another maker's drive."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import can

from hil.app.scenario.deployment import check_tick, operator_limits
from hil.app.scenario.deployment_tables import KEY_FILE, DataBitRate, LearningTable, check_key, check_no_key
from hil.app.scenario.reference import with_reference
from hil.app.scenario.scenario import BUS_TABLES, TABLES, TrackScenario, parse_track_scenario
from hil.bus.authenticated import authenticator, read_key
from hil.bus.local import LocalBus
from hil.drives.makers import ACTUATORS, read_actuator
from hil.drives.table import ActuatorTable
from hil.nodes.frame_map import frame_map_of, frames
from hil.nodes.operator import SETPOINT, OperatorLimits
from hil.simulated.faults import KEY, MAKER, OPERATOR, Fault, read_faults
from hil.simulated.fmu_plant import read_fmu
from hil.simulated.plant_node import SLOT_S
from models.files.toml import check_tables, check_word, in_file, read_toml, toml_text
from models.rigs.schema import NamedTable, Words, key


class SimulatedBusTable(NamedTable):
    """`[bus]` of a scenario; all nodes begin with the same epoch, which is not stored."""

    where = "bus"
    force_sensor: bool = key("whether the force sensor sends too", False)
    longest_s_per_s: float = key(
        "longest wall clock of a simulated second before the run fails; a run has at least 60 s", 60.0
    )
    fd: bool = key("opens the interface for CAN FD", False)
    data_bitrate: DataBitRate = key("bit rate of the data of CAN FD frames", 5_000_000)
    key_file: str = key(KEY_FILE, "")

    def model_post_init(self, _: Any) -> None:
        check_key(self.key_file, self.fd)
        if not self.longest_s_per_s > 0:
            raise ValueError(f"bus.longest_s_per_s must be positive; got {self.longest_s_per_s:g}")


class FmuTable(NamedTable):
    """`[plant]` of a scenario; instruments and hidden effects of sensors are still the scenario's."""

    where = "plant"
    fmu: str = key("FMU in place of the simulated plant, relative to the scenario; only `capsule sil` reads it")


_NUMBERS: Final = {"speed": ("MM_S", "SECONDS"), "position": ("MM", "SECONDS"), "release": ("SECONDS",)}
_LONGEST_S: Final = 86400.0  # a day


@dataclass(frozen=True, slots=True)
class Step:
    """One line: `mode` speed, position or release, its value in m/s or m, and how long it is sent."""

    mode: str
    value: float
    seconds: float


def steps(lines: Iterable[str], name: str) -> Iterator[Step]:
    """The steps of a script, empty lines and comments from `#` on left out. Raises ValueError naming the line."""
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        where = f"{name} line {number}"
        wanted = _NUMBERS[check_word(words[0][:40], f"{where}: step", _NUMBERS)]
        values = [_number(word) for word in words[1:]]
        if len(values) != len(wanted) or not all(map(math.isfinite, values)):
            raise ValueError(f"{where}: step must be '{words[0]} {' '.join(wanted)}'; got {line.strip()[:60]!r}")
        if not 0 < values[-1] <= _LONGEST_S:
            raise ValueError(f"{where}: seconds must lie above 0 and at most {_LONGEST_S:g}; got {values[-1]:g}")
        yield Step(words[0], 1e-3 * values[0] if len(values) == 2 else 0.0, values[-1])


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan


class JogTable(NamedTable):
    """`[jog]`: an operator who steers in a scenario."""

    where = "jog"
    script: Words = key(
        "what an operator does from the start of the run, in lines as for `capsule jog --script`: `speed MM_S SECONDS`,"
        " `position MM SECONDS`, `release SECONDS`. The first line is a release; one follows the last line"
    )
    source: str = key("who steers, by the names of `OperatorSetpoint`", "script")
    life_ms: float = key("how long each setpoint is valid after its arrival, less its delay on the bus", 100.0, 1, 200)

    def model_post_init(self, _: Any) -> None:
        check_word(self.source, "jog.source", list(frames()[SETPOINT].field("Source").names.values()))

    def planned(self) -> tuple[Step, ...]:
        """The steps, one after the other. Raises ValueError for a line that cannot be read."""
        return tuple(steps(self.script, "jog.script"))


@dataclass(frozen=True)
class SilScenario:
    """A closed `loop` over the bus with its faults; `drive` is another maker's, already set up."""

    loop: TrackScenario
    bus: SimulatedBusTable = SimulatedBusTable()
    faults: tuple[Fault, ...] = ()
    drive: ActuatorTable | None = None
    plant: FmuTable | None = None
    operator: OperatorLimits | None = None
    jog: JogTable | None = None
    learning: LearningTable = LearningTable()


def watched_bus(channel: str) -> LocalBus:
    """The local bus on which `capsule sil` shows a run to `capsule cockpit`. Raises ValueError."""
    try:
        return LocalBus(channel, fd=True)
    except can.CanInitializationError as error:
        raise ValueError(f"--watch must name a local bus that opens; got {channel!r}: {error}") from None


def load_sil_scenario(path: Path, reference: Path | None = None) -> tuple[SilScenario, str]:
    """Read and check a scenario file and its text, with the reference of another one where given. The paths of its FMU
    and its key become relative to the current folder. Raises ValueError.
    """
    raw, text = read_toml(path, "scenario")
    if reference is not None:
        raw = with_reference(raw, reference, "scenario")
        text = toml_text(raw)
    with in_file(path):
        scenario = parse_sil_scenario(raw)
        if scenario.plant is not None:
            fmu = path.parent / scenario.plant.fmu
            read_fmu(fmu, scenario.loop.truth)
            scenario = replace(scenario, plant=FmuTable(fmu=str(fmu)))
        if scenario.bus.key_file:
            key_file = path.parent / scenario.bus.key_file
            authenticator(read_key(key_file))
            scenario = replace(scenario, bus=scenario.bus.but(key_file=str(key_file)))
        return scenario, text


def parse_sil_scenario(raw: Mapping[str, Any]) -> SilScenario:
    """A loop over the bus from parsed TOML. Errors as `load_sil_scenario`."""
    own = (*BUS_TABLES, *ACTUATORS)
    check_tables(raw, (*TABLES, *own), own)
    loop = parse_track_scenario({name: table for name, table in raw.items() if name not in own})
    if "tick_s" not in raw.get("control", {}):
        cycle = frames()[frame_map_of(loop.kind).command].cycle_s
        loop = replace(loop, control=loop.control.but(tick_s=cycle))
    check_slots(loop.control.tick_s)
    check_tick(loop.control.tick_s, loop.kind, loop.limits)
    bus, faults = SimulatedBusTable.read(raw), read_faults(raw.get("faults", []), loop.duration_s)
    drive = read_actuator(raw, loop.kind, loop.limits)
    check_no_key(drive, bus.key_file)
    plant = FmuTable.read(raw) if "plant" in raw else None
    operator = operator_limits(raw, loop.limits) if "operator" in raw else None
    jog = JogTable.read(raw) if "jog" in raw else None
    if jog is not None:
        jog.planned()
        if not (operator and operator.accept):
            raise ValueError("operator.accept must be true with [jog], or no setpoints are accepted; got false")
    has = {MAKER: drive is not None, OPERATOR: jog is not None, KEY: bool(bus.key_file)}
    for fault in faults:
        fault.check_rig(loop.kind)
        if fault.needs and not has[fault.needs]:
            raise ValueError(f"faults.kind {fault.name} must stand {_MISSING[fault.needs]}")
    held = operator if operator and operator.accept else None
    return SilScenario(loop, bus, faults, drive, plant, held, jog, LearningTable.read(raw))


def check_slots(tick_s: float) -> None:
    """Refuse a tick that is no multiple of the simulated drive's slot. Raises ValueError."""
    slots = tick_s / SLOT_S
    if round(slots) < 1 or abs(slots - round(slots)) > 1e-6:
        raise ValueError(f"control.tick_s must be a multiple of {SLOT_S:g} s on the bus; got {tick_s:g}")


_MISSING: Final[Mapping[str, str]] = {
    MAKER: f"with one of [{'], ['.join(ACTUATORS)}], the drive that it concerns",
    OPERATOR: "with the table [jog], the operator",
    KEY: "with bus.key_file, the key of the frames that it corrupts",
}
