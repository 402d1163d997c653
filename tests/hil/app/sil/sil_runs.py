"""Short runs over the bus, one for each kind of drive, that tests and benches share."""

import atexit
import hashlib
import tempfile
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import can
import numpy as np

from controller.model.control_model import ControlModel
from hil.app.scenario.bus_scenario import SilScenario, parse_sil_scenario
from hil.app.sil.fault_outcomes import FaultOutcome, outcomes
from hil.app.sil.loop import SilTrace, run_sil
from hil.app.sil.testbed import believed_on_bus
from hil.simulated.faults import KEY, OPERATOR, Fault
from models.theta import Theta

RIGS: Final[Mapping[str, Mapping[str, Any]]] = MappingProxyType(
    {
        "magnetic": {
            "rig": {"kind": "magnetic", "magnet_stiffness_N_per_m": 24.2, "magnet_range_m": 0.02},
            "reference": {"kind": "ramp", "speed_mm_s": 3.0, "start_s": 0.1},
        },
        "coil": {"rig": {"kind": "coil"}, "reference": {"kind": "ramp", "speed_mm_s": 3.0, "start_s": 0.1}},
        "vibro": {
            "capsule": {"mass_kg": 0.193},
            "rig": {"kind": "vibro"},
            "drive": {"inner_mass_kg": 0.074, "spring_stiffness_N_per_m": 248.0, "force_N": 1.3},
            "surface": {"kind": "plate", "friction_coefficient": 0.31},
            "reference": {"kind": "ramp", "speed_mm_s": 10.0, "start_s": 0.1},
            "control": {"controller": "vibro"},
        },
    }
)

JOG: Final = {"script": ["release 0.02", "speed 0 0.08", "speed 3 60"], "life_ms": 45.0}
"""Somebody who is in charge from 0.02 s on and steers at 3 mm/s from 0.1 s on."""


@cache
def key_file() -> str:
    """A file with a key, the same one for all runs."""
    folder = tempfile.TemporaryDirectory(prefix="capsule-key-")
    atexit.register(folder.cleanup)
    path = Path(folder.name) / "bus.key"
    path.touch(0o600)
    path.write_text(bytes(range(16)).hex(), encoding="utf-8")
    return str(path)


def keyed() -> dict[str, Any]:
    """The table `[bus]` of an authenticated bus."""
    return {"fd": True, "key_file": key_file()}


def tables_for(faults: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The tables of a scenario that has what its `faults` need."""
    needs = {Fault(str(f["kind"]), 0.0, target=str(f.get("target", ""))).needs for f in faults}
    tables: dict[str, Any] = {}
    if OPERATOR in needs:
        tables |= {
            "reference": {"kind": "hold", "start_s": 0.1},
            "operator": {"accept": True, "stop_after_s": 0.05},
            "jog": JOG,
        }
    if KEY in needs:
        tables["bus"] = keyed()
    return tables


def scenario_of(kind: str, duration_s: float, *faults: Mapping[str, Any], **tables: Any) -> SilScenario:
    """A run of `duration_s` s of a rig of `kind`."""
    control = {"judged_from_s": 0.1, **RIGS[kind].get("control", {})}
    return parse_sil_scenario(
        {
            "scenario": {"name": kind, "duration_s": duration_s},
            **RIGS[kind],
            "control": control,
            "faults": list(faults),
            **tables_for(faults),
            **tables,
        }
    )


@cache
def model_of(kind: str) -> ControlModel:
    """What the controller of such a run believes."""
    return believed_on_bus(scenario_of(kind, 1.0), Theta())


def run(
    kind: str, duration_s: float, *faults: Mapping[str, Any], seed: int = 1, **tables: Any
) -> tuple[SilTrace, list[FaultOutcome]]:
    """Run it, and what came of its faults."""
    scenario = scenario_of(kind, duration_s, *faults, **tables)
    trace = run_sil(scenario, model_of(kind), scenario.loop.control.controller, seed)
    return trace, outcomes(scenario, trace)


class Digest:
    """Hashes frames with their times."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def __call__(self, message: can.Message) -> None:
        stamp = np.float64(message.timestamp).tobytes()
        self._hash.update(stamp + message.arbitration_id.to_bytes(4, "little") + bytes(message.data))

    def told(self) -> str:
        return self._hash.hexdigest()
