"""Tables of a deployment file beside the rig's: bus, control, learning, and the simulated plant."""

from typing import Annotated, Any, Final

import can
from pydantic import Field

from controller.registry import CONTROLLERS
from hil.app.scenario.scenario import ESTIMATOR, PROBE, Estimator
from hil.bus.catalogue import load_catalogue
from hil.drives.table import ActuatorTable
from models.rigs.schema import Among, NamedTable, key

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


NEAR_POINT: Final = 0.05  # Largest difference of a sample point from the one asked for


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


def check_key(key_file: str, fd: bool) -> None:
    """Refuse a key on a classic bus. Raises ValueError."""
    if key_file and not fd:
        raise ValueError("bus.fd must be true with bus.key_file, as an authenticator needs CAN FD; got false")


def check_no_key(drive: ActuatorTable | None, key_file: str) -> None:
    """Refuse a key beside another maker's drive. Raises ValueError."""
    if drive is not None and key_file:
        raise ValueError("bus.key_file must be left out with another maker's drive, which knows no such key; got one")
