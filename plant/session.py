"""The plant in a closed loop: a command goes in, time advances, readings come out."""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from plant import layout as at
from plant.hidden.table import effect_table
from plant.rig import Plant, Truth
from plant.sensing import Instrument, Reading, Stream
from plant.tables import Floats

_EVERY: Final = 10  # steps between rows of the truth
LOCALISATION: Final = Instrument()
FEEDBACK: Final = Instrument(rate_Hz=500.0, std=0.0, latency_s=0.0)


class Stepped(Protocol):
    """What a session steps: a `Plant` or a substitute with the same state and `advance`."""

    @property
    def rig(self) -> Truth:
        """The truth of the rig."""

    @property
    def state(self) -> Floats:
        """The present state."""

    @property
    def time(self) -> float:
        """Simulated time in s."""

    def advance(self, drive: Floats, every: int = 1) -> Floats:
        """Advance under `drive`; the recorded rows."""


@dataclass(frozen=True)
class Instruments:
    """The sensors of the loop: localisation of the capsule, and the drive's feedback (None: none)."""

    localisation: Instrument = LOCALISATION
    feedback: Instrument | None = FEEDBACK


class Session:
    """A rig commanded step by step. `newest` is the last row of the truth, `rows` all of it if the session `keeps` it
    for the evaluation; no controller may see either. A carriage moves in a straight line to each command in m; a coil
    holds a voltage in V, an inner mass without a coil the share 0..1 of its force. A carriage's feedback is its
    encoder, before lag and play. Same rig, instruments, seed and commands give the same numbers for any tick.
    """

    def __init__(
        self,
        rig: Truth,
        instruments: Instruments | None = None,
        seed: int = 0,
        command: float = 0.0,
        plant: Stepped | None = None,
        *,
        keeps: bool = True,
    ) -> None:
        """At rest at 0 under `command`. Raises ValueError for a capsule that is not free or impossible numbers."""
        if not rig.drive.free:
            raise ValueError(f"rig must have a free capsule (magnetic, coil, vibro); got {rig.drive.kind}")
        self.instruments = instruments = instruments or Instruments()
        self.plant: Stepped = plant or Plant(rig)
        self.command = float(command)
        self.rows: list[Floats] = []
        self.newest: Floats = np.zeros(at.O_COUNT)
        self._keeps = keeps
        rate = 1 / (_EVERY * rig.step_s)
        seeds = np.random.SeedSequence(seed).spawn(2)
        hidden = effect_table({name: dict(numbers) for name, numbers in rig.hidden.items()})
        place, feedback = (np.random.default_rng(seed) for seed in seeds)
        self._place = Stream("position_m", instruments.localisation, place, rate, hidden)
        self._drive: Stream | None = None
        if instruments.feedback is not None and rig.drive.feedback:
            self._drive = Stream(rig.drive.feedback, instruments.feedback, feedback, rate, None)
        self._waiting: list[Reading] = []
        self._shares = np.arange(2.0)

    @property
    def time(self) -> float:
        return self.plant.time

    def advance(self, command: float, until_s: float) -> tuple[Reading, ...]:
        """Advance under `command` to the step nearest to `until_s`; the readings that have newly arrived. Raises
        ValueError for a command not finite or a time less than a step ahead.
        """
        first = int(self.plant.state[at.S_STEP])
        steps = round(until_s / self.plant.rig.step_s) - first
        if steps < 1:
            raise ValueError(f"until_s must lie after {self.time:g} s by a step; got {until_s:g}")
        values = self.drive_values(command, steps)
        rows = self.plant.advance(values, _EVERY)
        self.command = float(command)
        if len(rows):
            self.newest = rows[-1]
        if self._keeps:
            self.rows.append(rows)
        self._waiting += self._place.take(rows[:, at.O_T], rows[:, at.O_X])
        if self._drive is not None:
            fed_back = rows[:, at.O_CURRENT]
            if self.plant.rig.drive.straight:
                fed_back = values[np.round(rows[:, at.O_T] / self.plant.rig.step_s).astype(int) - first]
            self._waiting += self._drive.take(rows[:, at.O_T], fed_back)
        now = self.time + 1e-9
        if not any(r.arrives_s <= now for r in self._waiting):
            return ()
        ready = tuple(sorted((r for r in self._waiting if r.arrives_s <= now), key=lambda r: (r.arrives_s, r.channel)))
        self._waiting = [r for r in self._waiting if r.arrives_s > now]
        return ready

    def drive_values(self, command: float, steps: int) -> Floats:
        """The plant's drive for the next `steps` steps, (steps + 1,), as `Plant.advance` takes it."""
        drive = self.plant.rig.drive
        if drive.straight:
            if self._shares.size != steps + 1:
                self._shares = np.arange(steps + 1) / steps
            values: Floats = self.command + (command - self.command) * self._shares
            values[-1] = command
            return values
        return np.full(steps + 1, drive.command_scale * command)
