"""What a drive is: how a command becomes motion or force, and what is measured."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

from models.formula import Line
from models.parameter import Parameter
from models.words.sentences import Sentences

Values = Mapping[str, Any]
TEXT: Final = Sentences(__file__)


@dataclass(frozen=True)
class Actuation:
    """Inputs of a drive in one step of `h` s: the body's position `x` in m and speed `v` in m/s at mid-step, its speed
    `start` before, the `command` at mid-step, the parameters `p` and the drive's own states `z` by name. Effects add
    the factor `gain` on the force, `suspension(stretch, rate)` in N to an inner mass's spring, and the factor
    `reach(stretch)` on its coil's force.
    """

    x: Any
    v: Any
    start: Any
    command: Any
    h: Any
    p: Values
    z: Values = field(default_factory=dict)
    gain: Any = 1.0
    suspension: Callable[[Any, Any], Any] = field(default=lambda stretch, rate: 0.0)
    reach: Callable[[Any], Any] = field(default=lambda stretch: 1.0)


@dataclass(frozen=True)
class Push:
    """Output of a drive in one step: its mean `force` in N, the `inertia` in kg that it adds to the body's (a mass on a
    spring, solved implicitly), and its states `after(speed at the step's end, mean speed)`.
    """

    force: Any
    inertia: Any = 0.0
    after: Callable[[Any, Any], dict[str, Any]] = field(default=lambda end, mean: {})


@dataclass(frozen=True)
class Drive:
    """A drive as it is modelled. `imposed`: the command is the capsule's position, and the force on it is measured.
    `anchored`: the command is a position, so that the distance from it shows the wall's force; else a position is only
    known relative to its start.

    `states` are the drive's own, all 0 at the start; `command_unit` is what a command of 1 is in the driven column's
    unit; `carried_kg` rides on the body and presses it down. `turning` finds the moment within the step at which the
    body turns or stops, for drives that shake it in every cycle. `held`: the command is a switch, which keeps over a
    step its value at the beginning; else it changes linearly. `by_voltage`: the command is a coil's voltage, and its
    current a state. `launched`: a body of inertia that starts with the place and the speed that its record begins with;
    an observer corrects both within about `remembers_s`. `leaves_open` are keys of the sentences on what records do not
    identify.
    """

    name: ClassVar[str] = ""
    commanded: ClassVar[str] = ""
    measured: ClassVar[str] = ""
    imposed: ClassVar[bool] = False
    anchored: ClassVar[bool] = False
    states: ClassVar[tuple[str, ...]] = ()
    turning: ClassVar[bool] = False
    held: ClassVar[bool] = False
    by_voltage: ClassVar[bool] = False
    launched: ClassVar[bool] = False
    remembers_s: ClassVar[float] = 0.0
    leaves_open: ClassVar[tuple[str, ...]] = ("start",)

    @property
    def stepped(self) -> bool:
        """Whether the command keeps over a step its value at the beginning."""
        return self.held

    @property
    def command_unit(self) -> float:
        """Value of the driven column that is a command of 1."""
        return 1.0

    @property
    def carried_kg(self) -> float:
        """Mass in kg that the body carries in addition to its own."""
        return 0.0

    @property
    def gap_limit_m(self) -> float | None:
        """The gap between command and body in m at which a magnet pulls most; None where there is no such gap."""
        return None

    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters of the drive that calibration may fit."""
        return ()

    def equations(self, p: Values) -> list[Line]:
        """How the command becomes a force, a line each."""
        return []

    def unidentifiable(self) -> list[str]:
        """Sentences on what records under this drive cannot identify."""
        return [TEXT(key) for key in self.leaves_open]

    def inertia(self, p: Values) -> float:
        """Inertia in kg (kg m2) that comes with the drive and not with the body."""
        return 0.0

    def command_for(self, force: Any, x: Any, v: Any, p: Values) -> Any:
        """The command that pushes with `force` in N at `x` in m and `v` in m/s in the steady state: the inverse of
        `force` within the drive's range; 0 where there is none.
        """
        return 0.0

    def force(self, x: Any, v: Any, command: Any, p: Values) -> Any:
        """Force on the capsule along +x in N."""
        return 0.0

    def neutral(self, x: Any) -> Any:
        """The command that puts no force on a body at `x` in m."""
        return 0.0

    def pressing(self, x: Any, command: Any, p: Values) -> Any:
        """Force in N with which the drive presses the body on its surface, in addition to the weights."""
        return 0.0

    def push(self, at: Actuation) -> Push:
        """What the drive does in one step; drives with states of their own replace it."""
        return Push(at.gain * self.force(at.x, at.v, at.command, at.p))
