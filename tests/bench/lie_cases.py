"""What the bench of lies runs: the lies in three sizes each, the references, and sound rigs drawn at random."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from models.effects import CATALOGUE
from plant.hidden.registry import HIDDEN
from tests.plant.series import answer_of, draw

Fault = Mapping[str, Any]
REFERENCES: Final[Mapping[str, Mapping[str, Mapping[str, Any]]]] = MappingProxyType(
    {
        "hold": {rig: {"kind": "hold", "start_s": 0.3} for rig in ("magnetic", "coil", "vibro")},
        "ramp": {
            rig: {"kind": "ramp", "speed_mm_s": speed, "start_s": 0.3}
            for rig, speed in (("magnetic", 5.0), ("coil", 5.0), ("vibro", 10.0))
        },
        "sine": {
            rig: {"kind": "sine", "amplitude_mm": 20.0, "frequency_Hz": hertz, "start_s": 0.3}
            for rig, hertz in (("magnetic", 0.15), ("coil", 0.15), ("vibro", 0.1))
        },
    }
)
"""Where to go: nowhere; on and on; and out and back, so that a capsule that is left behind is too far."""
EVERY_RIG: Final = ("magnetic", "coil", "vibro")
PLACED: Final = ("magnetic",)


@dataclass(frozen=True)
class Case:
    """A kind of lie: the faults of each of three sizes, the rigs that can have it, and how long a run takes in s."""

    sizes: tuple[tuple[Fault, ...], ...]
    rigs: tuple[str, ...] = EVERY_RIG
    seconds: float = 7.0


def one(kind: str, at_s: float = 1.0, **more: Any) -> tuple[Fault, ...]:
    """One lie."""
    return ({"kind": kind, "at_s": at_s, **more},)


def by_value(kind: str, *values: float, **more: Any) -> tuple[tuple[Fault, ...], ...]:
    """One lie in these sizes."""
    return tuple(one(kind, value=value, **more) for value in values)


def by_begin(kind: str, **more: Any) -> tuple[tuple[Fault, ...], ...]:
    """One lie without a size, from the start on, at rest and on the way."""
    return tuple(one(kind, at_s, **more) for at_s in (0.0, 1.0, 2.5))


def alike(kind: str, drive: float | None, told: float | None) -> tuple[tuple[Fault, ...], ...]:
    """Localiser and drive lie together, from the start on, at rest and on the way."""
    return tuple(
        (
            {"kind": kind, "at_s": at_s, "target": "drive", **({} if drive is None else {"value": drive})},
            {"kind": kind, "at_s": at_s, "target": "localisation", **({} if told is None else {"value": told})},
        )
        for at_s in (0.0, 1.0, 2.5)
    )


def drift(speed_mm_s: float) -> Case:
    """A drift one way, the other way, and one that ends at 15 mm."""
    value = 1e-3 * speed_mm_s
    sizes = (one("drift", value=value), one("drift", value=-value), one("drift", value=value, size_m=0.015))
    return Case(sizes, seconds=min(3.0 + 20.0 / speed_mm_s, 43.0))


def restless_before(*values: float) -> tuple[tuple[Fault, ...], ...]:
    """A drive that moves by itself before it has been enabled."""
    return by_value("restless", *values, at_s=0.0)


def restless_after(*values: float) -> tuple[tuple[Fault, ...], ...]:
    """A drive that moves by itself after the controller has stopped it."""
    stop = {"kind": "late_solve", "at_s": 1.0, "duration_s": 0.05}
    return tuple((stop, *one("restless", 1.2, value=value)) for value in values)


LIES: Final[Mapping[str, Case]] = MappingProxyType(
    {
        **{f"drift {speed:g} mm/s": drift(speed) for speed in (0.5, 1.0, 2.0, 5.0, 20.0)},
        "flipped": Case(by_begin("flipped")),
        "turned": Case(by_begin("turned")),
        "halved": Case(by_value("scaled", 0.3, 0.5, 0.7)),
        "doubled": Case(by_value("scaled", 1.5, 2.0, 3.0)),
        "late, true stamp": Case(by_value("late", 0.06, 0.09, 0.12)),
        "late, no stamp": Case(by_value("late_unsaid", 0.06, 0.12, 0.25)),
        "held": Case(by_begin("held")),
        "swapped": Case(by_begin("swapped"), ("magnetic", "vibro")),
        "of another rig": Case(by_value("foreign", 0.005, 0.01, 0.02)),
        "jumped": Case(by_value("jumped", 0.002, 0.004, 0.01)),
        "jumped and back": Case(by_value("jumped", 0.002, 0.004, 0.01, duration_s=0.5)),
        "sway": Case(by_value("sway", 0.005, 0.01, 0.02), seconds=10.0),
        "noisy": Case(by_value("noisy", 5.0, 10.0, 20.0)),
        "coarse": Case(by_value("coarse", 0.001, 0.002, 0.005)),
        "drive stands": Case(by_begin("held", target="drive")),
        "drive on": Case(by_value("held", 0.3, 0.6, 1.0, target="drive"), ("coil", "vibro")),
        "drive turned": Case(by_begin("turned", target="drive")),
        "drive doubled": Case(by_value("scaled", 1.5, 2.0, 3.0, target="drive")),
        "drive halved": Case(by_value("scaled", 0.3, 0.5, 0.7, target="drive")),
        "drive sticks and jumps": Case(by_value("sticks", 0.002, 0.005, 0.01), PLACED),
        "drive restless before": Case(restless_before(0.02, 0.05, 0.1)),
        "drive restless after": Case(restless_after(0.05, 0.1, 0.2), seconds=3.0),
        "report held": Case(by_begin("held", target="feedback")),
        "report drifts": Case(by_value("drift", 0.002, 0.005, 0.02, target="feedback"), ("magnetic", "coil")),
        "report turned": Case(by_begin("turned", target="feedback")),
        "report scaled": Case(by_value("scaled", 0.5, 0.8, 2.0, target="feedback")),
        "both turned": Case(alike("turned", None, None)),
        "both doubled": Case(alike("scaled", 2.0, 2.0)),
        "both halved": Case(alike("scaled", 0.5, 0.5)),
        "drive doubled, told halved": Case(alike("scaled", 2.0, 0.5)),
        "both stand": Case(alike("held", None, None)),
    }
)


def scaled_rig(rig: str, rng: np.random.Generator) -> dict[str, Any]:
    """A rig of this kind, its gut and magnet stiffer or softer by up to 15 % than the controller believes."""
    share = rng.uniform(0.85, 1.15, 2)
    tissue = {"hoop_stress_factor": float(share[0])}
    if rig == "magnetic":
        magnet = 24.2 * float(share[1])
        return {"tissue": tissue, "rig": {"kind": rig, "magnet_stiffness_N_per_m": magnet, "magnet_range_m": 0.02}}
    return {"tissue": tissue} if rig == "coil" else {}


SOUND: Final = ("friction", "force", "wall")
"""Files of the catalogue whose effects a sound rig may have: friction, waves, folds, narrow places, walls. What a
drive or a sensor gets wrong lies of its own accord.
"""


def hidden_of(rig: str) -> list[str]:
    """What may hide in a sound rig of this kind."""
    gut = {name for name, effect in CATALOGUE.items() if effect.__module__.split(".")[2] in SOUND}
    return [h.id for h in HIDDEN if rig in h.drives and answer_of(h.id) in gut]


def sound(number: int, rig: str) -> dict[str, Any]:
    """The tables of the sound run `number` on a rig of this kind: one or two hidden effects at drawn sizes, a gut of
    its own, and a localisation of drawn noise, rate and latency.
    """
    rng = np.random.default_rng([number, EVERY_RIG.index(rig)])
    chosen = rng.choice(np.array(hidden_of(rig)), size=int(rng.integers(1, 3)), replace=False)
    return {
        **scaled_rig(rig, rng),
        **({} if rig == "vibro" else {"anatomy": {"seed": number}}),
        "effects": {str(name): draw(str(name), rng) for name in chosen},
        "localisation": {
            "std": float(rng.uniform(0.05e-3, 0.3e-3)),
            "rate_Hz": float(rng.choice([100.0, 200.0, 500.0])),
            "latency_s": float(rng.uniform(2e-3, 20e-3)),
        },
    }
