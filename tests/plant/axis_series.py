"""Series of simulated benches: an axis on imposed motions, with what its model may lack in forms of their own."""

import math
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from models.files.toml import toml_text

Floats = NDArray[np.float64]
Bench = Callable[[dict[str, Floats], np.random.Generator, float], tuple[Floats, Floats, dict[str, Floats]]]
"""Friction and further force on a motion, and the logged columns beside place and force, by the size of what is hidden,
1 as usual.
"""
NOISE_N: Final = 0.2


def motion(seed: int, seconds: float = 16.0, rate: float = 250.0) -> dict[str, Floats]:
    """Three tones that do not repeat within the record."""
    rng, t = np.random.default_rng(seed), np.arange(0, seconds, 1 / rate)
    turns = 2 * np.pi * np.array([[0.17], [0.43], [1.31]]) * rng.uniform(0.9, 1.1, (3, 1))
    at, size = turns * t + rng.uniform(0, 6, (3, 1)), np.array([[0.06], [0.02], [0.008]])
    x, v, a = (np.sum(size * turns**k * w, axis=0) for k, w in enumerate((np.sin(at), np.cos(at), -np.sin(at))))
    return {"t": t, "x": x, "v": v, "a": a, "path": np.cumsum(np.abs(np.diff(x, prepend=x[:1])))}


def columns(
    bench: Bench, seed: int, size: float = 1.0, noise: float = 1.0, seconds: float = 16.0, rate: float = 250.0
) -> dict[str, Floats]:
    """The columns of a record: 5 kg and 20 N s/m beside the bench's friction, noise in the force."""
    m, rng = motion(seed, seconds, rate), np.random.default_rng(seed)
    friction, force, logged = bench(m, rng, size)
    total = 5 * m["a"] + 20 * m["v"] + friction + 0.3 + force + noise * NOISE_N * rng.standard_normal(len(m["t"]))
    return {"t_s": m["t"], "position_m": m["x"], "force_N": total, **logged}


def coulomb(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Nothing hidden, beside inputs that do nothing."""
    pressure = 2e5 + 1e5 * np.sign(np.sin(0.9 * m["t"] + rng.uniform(0, 6)))
    return 3 * np.sign(m["v"]), 0 * m["t"], {"pressure_Pa": pressure, "temperature_degC": 22 + 0.3 * m["t"]}


def piston(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """A pressure that pushes through an area that a rolling seal changes, and a temperature that does nothing."""
    friction, _, logged = coulomb(m, rng, size)
    return friction, -2e-4 * size * logged["pressure_Pa"] * (1 + 0.03 * np.tanh(m["x"] / 0.05)), logged


def slipping(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Maxwell slip: four springs, each of which slips at its own stretch."""
    friction, most = np.zeros(len(m["x"])), np.array([0.2, 0.6, 1.5, 4.0]) * 2e-3 * size
    stretch = np.zeros(4)
    for k, (a, b) in enumerate(pairwise(m["x"]), 1):
        stretch = np.clip(stretch + b - a, -most, most)
        friction[k] = 3 * float(np.mean(stretch / most))
    return friction, np.zeros(len(friction)), {}


def cogging(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Poles every 18 mm whose force is a triangle over the place."""
    return 3 * np.sign(m["v"]), 0.8 * size * scipy.signal.sawtooth(2 * math.pi * m["x"] / 0.018, 0.5), {}


def thinning(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Friction, viscous and dry, that falls as a hyperbola over the path."""
    level = 1 / (1 + size * m["path"] / 0.8)
    return level * (3 * np.sign(m["v"]) + 20 * m["v"]) - 20 * m["v"], np.zeros(len(level)), {}


def two_masses(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """2 kg on a spring that stiffens, with a damper to the frame."""
    x, v, dt = m["x"], m["v"], float(m["t"][1])
    shaken = x + 4e-4 * scipy.signal.chirp(m["t"], 2, m["t"][-1], 14)
    x[:], fine = shaken, 20
    v[:] = np.gradient(x, dt)
    m["a"][:] = np.gradient(v, dt)
    place, speed, force = x[0], v[0], np.zeros(len(x))
    mass = 2 * size
    for k in range(1, len(x)):
        for j in range(fine):
            e = x[k - 1] + (x[k] - x[k - 1]) * (j + 0.5) / fine - place
            pull = mass * (2 * math.pi * 7) ** 2 * e * (1 + (e / 4e-3) ** 2)
            speed += dt / fine * (pull - 6 * speed + 6 * (v[k] - speed)) / mass
            place += dt / fine * speed
        e = x[k] - place
        force[k] = mass * (2 * math.pi * 7) ** 2 * e * (1 + (e / 4e-3) ** 2) + 6 * (v[k] - speed)
    return 3 * np.sign(v), force, {}


def weakening(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Friction with a peak at low speed, a power law of the speed."""
    return (3 + 2 * size / (1 + (np.abs(m["v"]) / 0.012) ** 1.5)) * np.sign(m["v"]), 0 * m["t"], {}


def one_sided(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Dry and viscous friction that are greater forwards."""
    more = np.where(m["v"] > 0, 0.25 * size * (3 + 20 * m["v"]), 0.0)
    return 3 * np.sign(m["v"]) + more, 0 * m["t"], {}


def jumping(m: dict[str, Floats], rng: np.random.Generator, size: float) -> tuple[Floats, Floats, dict[str, Floats]]:
    """A force that jumps whenever another 0.3 m have been travelled: nothing that the catalogue has."""
    return 3 * np.sign(m["v"]), 0.8 * size * (np.floor(m["path"] / 0.3) % 2), {}


BENCHES: Final[Mapping[str, Bench]] = {
    "load_force": piston,
    "presliding": slipping,
    "torque_ripple": cogging,
    "warming": thinning,
    "elastic_drive": two_masses,
    "stribeck": weakening,
    "directional_asymmetry": one_sided,
    "travel_step": jumping,
}
"""What hides on an axis by the catalogue's name for it; the last has none."""


def make_axis_series(effect: str | None, seed: int, out: Path, duration_s: float, noise: float, rate_Hz: float) -> Path:
    """As `tests.plant.series.make_series`: what is hidden has half to one and a half times its usual size."""
    bench, out_names = BENCHES[effect] if effect else coulomb, ("train_1", "train_2", "train_3", "holdout")
    size = float(np.random.default_rng(seed).uniform(0.5, 1.5))
    out.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(out_names):
        made = columns(bench, 10 * seed + k, size, noise, duration_s, rate_Hz)
        np.savetxt(
            out / f"{name}.csv.gz", np.transpose(list(made.values())), "%.9g", ",", header=",".join(made), comments=""
        )
    rig = {"rig": {"kind": "axis"}, "noise": {"force_std_N": noise * NOISE_N}}
    (out / "rig.toml").write_text(toml_text(rig), encoding="utf-8")
    (out / "answer.toml").write_text(f'effect = "{effect or "none"}"\nseed = {seed}\nsize = {size:.6g}\n', "utf-8")
    return out
