"""The table `[[faults]]`: kind, time, duration and target of each fault."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pydantic import TypeAdapter

from models.files.toml import beside, check_word
from models.parameter import nearest
from models.rigs.schema import from_table

SETPOINTS: Final = "setpoints"  # the link from the operator to the controller
DRIVE: Final = "drive"  # the true motion of the drive, while its report follows the command
MAKER, OPERATOR, KEY = "maker", "operator", "key"
"""Requirements of a fault on its scenario: a drive of another maker, an operator, an authenticated bus."""


@dataclass(frozen=True)
class FaultKind:
    """A kind of fault: effect, targets, meaning of its `value`, requirement, rigs that have it. See `faults.toml`."""

    summary: str
    targets: tuple[str, ...] = ("",)
    value: float = math.nan
    meaning: str = ""
    range: tuple[float, float] = (-math.inf, math.inf)
    needs: str = ""
    rigs: tuple[str, ...] = ()
    lie: bool = False
    safe_s: float = math.nan


KINDS: Final = TypeAdapter(dict[str, FaultKind]).validate_python(beside(__file__, "faults.toml"))
LIES: Final = {name: kind for name, kind in KINDS.items() if kind.lie}


@dataclass(frozen=True)
class Fault:
    """One fault; by default a lie lasts for ever and any other fault for 0.2 s. A drift grows to `size_m`."""

    kind: str
    at_s: float
    duration_s: float = math.nan
    target: str = ""
    value: float = math.nan
    size_m: float = math.nan

    def __post_init__(self) -> None:
        check_word(self.kind, "faults.kind", KINDS)
        known = KINDS[self.kind]
        choices = ", ".join(target for target in known.targets if target)
        wanted = f"one of {choices}" if choices else "left out"
        self._must("target", not self.target or self.target in known.targets, wanted, repr(self.target))
        if not 0 <= self.at_s < math.inf:
            raise ValueError(f"faults.at_s must be zero or more; got {self.at_s:g}")
        if math.isnan(self.duration_s):
            object.__setattr__(self, "duration_s", math.inf if self.kind in LIES else 0.2)
        if not self.duration_s > 0:
            raise ValueError(f"faults.duration_s must be positive; got {self.duration_s:g}")
        fine = math.isnan(self.value) or (known.meaning and math.isfinite(self.value))
        self._must("value", fine, f"a number ({known.meaning})" if known.meaning else "left out", f"{self.value:g}")
        least, most = known.range
        if known.meaning and not (math.isnan(self.amount) or least <= self.amount <= most):
            limits = f"[{least:g}, {most:g}] ({known.meaning})"
            raise ValueError(f"faults.value of {self.kind} must lie in {limits}; got {self.value:g}")
        fine = self.kind != "replay" or self.amount == int(self.amount)
        self._must("value", fine, "a whole number of frames", f"{self.value:g}")
        fine = math.isnan(self.size_m) or (self.kind == "drift" and 0 < self.size_m < math.inf)
        wanted = "a positive number of m" if self.kind == "drift" else "left out"
        self._must("size_m", fine, wanted, f"{self.size_m:g}")
        object.__setattr__(self, "target", self.target or known.targets[0])

    def _must(self, key: str, fine: object, wanted: str, got: str) -> None:
        if not fine:
            raise ValueError(f"faults.{key} of {self.kind} must be {wanted}; got {got}")

    @property
    def amount(self) -> float:
        return KINDS[self.kind].value if math.isnan(self.value) else self.value

    @property
    def needs(self) -> str:
        return OPERATOR if self.target == SETPOINTS else KINDS[self.kind].needs

    def check_rig(self, kind: str) -> None:
        """Raises ValueError for a `kind` of rig without this fault."""
        rigs = KINDS[self.kind].rigs
        if rigs and kind not in rigs:
            raise ValueError(f"faults.kind {self.name} must stand with rig.kind {' or '.join(rigs)}; got {kind!r}")

    @property
    def end_s(self) -> float:
        return self.at_s + self.duration_s

    @property
    def name(self) -> str:
        return f"{self.kind} {self.target}".strip()


def read_faults(tables: Any, duration_s: float) -> tuple[Fault, ...]:
    """The faults of a scenario in order of time. Raises ValueError of one sentence that names the key."""
    if not isinstance(tables, Sequence) or isinstance(tables, str) or not all(isinstance(t, Mapping) for t in tables):
        raise ValueError(f"faults must be tables [[faults]]; got {tables!r}")
    found = sorted((from_table(Fault, t, "faults") for t in tables), key=lambda f: f.at_s)
    for fault in found:
        if fault.at_s >= duration_s:
            raise ValueError(f"faults.at_s must lie within the run of {duration_s:g} s; got {fault.at_s:g}")
    return tuple(found)


def read_lie(text: str) -> Fault:
    """The lie typed as `KIND[:TARGET][=VALUE][@AT_S]`. Raises ValueError for other text."""
    found = re.fullmatch(r"(\w+)(?::(\w+))?(?:=([^@]+))?(?:@(.+))?", text)
    try:
        kind, target, value, at_s = found.groups() if found else ("", "", "", "")
        if kind not in LIES:
            raise ValueError(f"the kind must be one of {', '.join(LIES)}; {nearest(kind, LIES)}")
        return Fault(kind, float(at_s or 0.0), math.inf, target or "", float(value) if value else math.nan)
    except ValueError as error:
        raise ValueError(f"--lie must be KIND[:TARGET][=VALUE][@AT_S], of a lie; got {text!r}: {error}") from None
