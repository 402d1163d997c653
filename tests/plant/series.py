"""Simulated series of experiments: training and hold-out records of an example rig, with hidden effects if any."""

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from models.files.toml import toml_text
from plant.experiments.examples import BELIEVED
from plant.experiments.scenario import write_record
from plant.hidden.registry import SIGNED, hidden
from plant.rig import Truth

KINDS: Final = tuple(BELIEVED)
_CATALOGUE: Final = {
    "nose_asymmetry": "directional_asymmetry",
    "film_weakening": "stribeck",
    "slip_folds": "fold_periodic",
    "dipole_load": "magnet_normal_load",
    "driver_lag": "actuator_lag",
    "spring_stiffening": "spring_hardening",
    "guide_rubbing": "guide_friction",
    "coil_field": "coil_reach",
}  # names of hidden effects in the catalogue, if they differ
_OUTSIDE: Final = ("travel_step", "rolling_wobble", "attraction_load")  # of the catalogue
RECORDS: Final = ("train_1", "train_2", "train_3", "holdout")


def make_series(
    kind: str,
    effect: str | None,
    seed: int,
    out: Path,
    duration_s: float = 45.0,
    noise: float = 1.0,
    rate_Hz: float = 500.0,
) -> Path:
    """Write `train_1..3.csv.gz`, `holdout.csv.gz`, `rig.toml` (nominal values) and `answer.toml` (the truth) to `out`.

    The truth differs from nominal by up to 15 % in hoop stress and friction, 5 % in a magnet's stiffness, 7 % in a
    coil's or inner mass's force and spring (a magnet's on a plate too). `coil` logs the current, `coil_voltage` the
    voltage alone; `vibro` is in the gut, `vibro_plate` the capsubot on a plate. `effect` is a hidden effect's id, or
    several joined by "+", with numbers drawn from their ranges. `noise` times 1 mN on a pull's force, 50 um on a
    position. The same seed gives the same bytes; its rig, drive and noise stay the same with another effect. Raises
    `ValueError` for an unknown kind or effect, or one that the drive cannot have.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}; got {kind!r}")
    ids = hidden_ids(effect)
    for name in ids:
        if BELIEVED[kind].kind not in hidden(name).drives:
            raise ValueError(
                f"effect of a {kind} rig must be one for that kind; got {name!r}, which is for"
                f" {', '.join(hidden(name).drives)}"
            )
    truth, *streams = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(2 + len(RECORDS)))
    effect_stream, *record_streams = streams
    belief = BELIEVED[kind]
    rig = replace(belief.truth(truth), hidden={name: draw(name, effect_stream) for name in ids})
    out.mkdir(parents=True, exist_ok=True)
    for name, rng in zip(RECORDS, record_streams, strict=True):
        write_record(out / f"{name}.csv.gz", belief.record(rig, rng, duration_s, noise, rate_Hz))
    (out / "rig.toml").write_text(toml_text(belief.tables(noise)), encoding="utf-8")
    (out / "answer.toml").write_text(_answer_text(rig, effect, seed), encoding="utf-8")
    return out


def hidden_ids(effect: str | None) -> list[str]:
    """The ids that `effect` names, joined by "+"; none for None."""
    return effect.split("+") if effect else []


def _answer_text(rig: Truth, effect: str | None, seed: int) -> str:
    lines = [f'effect = "{effect or "none"}"', f"seed = {seed}"]
    lines += [] if rig.surface else [f"hoop_stress_factor = {rig.hoop_factor:.6g}"]
    lines += [f"friction_coefficient = {(rig.surface or rig.tissue).friction_coefficient:.6g}"]
    lines += [
        f"{name} = {value:.6g}"
        for name, value in ((key, getattr(rig.drive, own)) for key, own in rig.drive.calibrated.items())
    ]
    for name, numbers in rig.hidden.items():
        lines += [
            "",
            f"[parameters.{name}]" if len(rig.hidden) > 1 else "[parameters]",
            f'form = "{hidden(name).form}"',
            f"published = {str(published(name)).lower()}",
        ]
        lines += [f"{key} = {value:.6g}" for key, value in numbers.items()]
    return "\n".join([*lines, ""])


def draw(name: str, rng: np.random.Generator) -> dict[str, float]:
    """Random numbers for an effect, evenly from their ranges; a signed one is negative half of the time."""
    numbers = {}
    for number in hidden(name).numbers:
        value = float(rng.uniform(number.lower, number.upper))
        numbers[number.name] = -value if number.sign == SIGNED and rng.random() < 0.5 else value
    return numbers


def answer_of(effect: str) -> str:
    """The effect of the catalogue that a search should name for a hidden one."""
    return _CATALOGUE.get(effect, effect)


def published(effect: str) -> bool:
    """Whether the catalogue has the hidden effect."""
    return effect not in _OUTSIDE
