"""What benches add to an axis is found in forms that are not the catalogue's."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
import scipy
from numpy.typing import NDArray

from models.identification import close
from models.identification.finding import Finding
from models.records.record import Record, record_of
from models.rigs.reader import parse_rig

Floats = NDArray[np.float64]
RIG = parse_rig({"rig": {"kind": "axis"}, "noise": {"force_std_N": 0.2}})
Bench = Callable[[dict[str, Floats], np.random.Generator], tuple[Floats, Floats, dict[str, Floats]]]
"""Friction and further force on a motion, and the logged columns beside place and force."""


def motion(seed: int, seconds: float = 16.0, rate: float = 250.0) -> dict[str, Floats]:
    """Three tones that do not repeat within the record."""
    rng, t = np.random.default_rng(seed), np.arange(0, seconds, 1 / rate)
    turns = 2 * np.pi * np.array([[0.17], [0.43], [1.31]]) * rng.uniform(0.9, 1.1, (3, 1))
    at, size = turns * t + rng.uniform(0, 6, (3, 1)), np.array([[0.06], [0.02], [0.008]])
    x, v, a = (np.sum(size * turns**k * w, axis=0) for k, w in enumerate((np.sin(at), np.cos(at), -np.sin(at))))
    return {"t": t, "x": x, "v": v, "a": a, "path": np.cumsum(np.abs(np.diff(x, prepend=x[:1])))}


def record(bench: Bench, seed: int) -> Record:
    m, rng = motion(seed), np.random.default_rng(seed)
    friction, force, logged = bench(m, rng)
    total = 5 * m["a"] + 20 * m["v"] + friction + 0.3 + force + 0.2 * rng.standard_normal(len(m["t"]))
    return record_of(f"run_{seed}", {"t_s": m["t"], "position_m": m["x"], "force_N": total, **logged}, RIG)


def closed(bench: Bench) -> Finding:
    return close(RIG, [record(bench, 1), record(bench, 2)], [record(bench, 3)], lambda stage, share: None)[0]


def coulomb(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Nothing hidden, beside inputs that do nothing."""
    pressure = 2e5 + 1e5 * np.sign(np.sin(0.9 * m["t"] + rng.uniform(0, 6)))
    return 3 * np.sign(m["v"]), 0 * m["t"], {"pressure_Pa": pressure, "temperature_degC": 22 + 0.3 * m["t"]}


def piston(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """A pressure that pushes through an area that a rolling seal changes, and a temperature that does nothing."""
    friction, _, logged = coulomb(m, rng)
    return friction, -2e-4 * logged["pressure_Pa"] * (1 + 0.03 * np.tanh(m["x"] / 0.05)), logged


def slipping(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Maxwell slip: four springs, each of which slips at its own stretch."""
    friction, most = np.zeros(len(m["x"])), np.array([0.2, 0.6, 1.5, 4.0]) * 2e-3
    stretch = np.zeros(4)
    for k, (a, b) in enumerate(pairwise(m["x"]), 1):
        stretch = np.clip(stretch + b - a, -most, most)
        friction[k] = 3 * float(np.mean(stretch / most))
    return friction, np.zeros(len(friction)), {}


def cogging(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Poles every 18 mm whose force is a triangle over the place."""
    return 3 * np.sign(m["v"]), 0.8 * scipy.signal.sawtooth(2 * math.pi * m["x"] / 0.018, 0.5), {}


def thinning(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Friction, viscous and dry, that falls as a hyperbola over the path."""
    level = 1 / (1 + m["path"] / 0.8)
    return level * (3 * np.sign(m["v"]) + 20 * m["v"]) - 20 * m["v"], np.zeros(len(level)), {}


def two_masses(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """2 kg on a spring that stiffens, with a damper to the frame."""
    x, v, dt = m["x"], m["v"], float(m["t"][1])
    shaken = x + 4e-4 * scipy.signal.chirp(m["t"], 2, m["t"][-1], 14)
    x[:], fine = shaken, 20
    v[:] = np.gradient(x, dt)
    m["a"][:] = np.gradient(v, dt)
    place, speed, force = x[0], v[0], np.zeros(len(x))
    for k in range(1, len(x)):
        for j in range(fine):
            e = x[k - 1] + (x[k] - x[k - 1]) * (j + 0.5) / fine - place
            pull = 2 * (2 * math.pi * 7) ** 2 * e * (1 + (e / 4e-3) ** 2)
            speed += dt / fine * (pull - 6 * speed + 6 * (v[k] - speed)) / 2
            place += dt / fine * speed
        e = x[k] - place
        force[k] = 2 * (2 * math.pi * 7) ** 2 * e * (1 + (e / 4e-3) ** 2) + 6 * (v[k] - speed)
    return 3 * np.sign(v), force, {}


def test_an_axis_with_idle_inputs_lacks_nothing() -> None:
    finding = closed(coulomb)
    assert (finding.verdict, finding.effects) == ("none", ())


@pytest.mark.parametrize(
    ("bench", "effect"),
    [
        (piston, "load_force"),
        (slipping, "presliding"),
        (cogging, "torque_ripple"),
        (thinning, "warming"),
        (two_masses, "elastic_drive"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_bench_is_found(bench: Bench, effect: str) -> None:
    finding = closed(bench)
    assert [found.id for found in finding.effects][:1] == [effect]
    held = finding.error["holdout"]
    assert held["augmented"] < 0.5 * held["calibrated"]


def lubricated(m: dict[str, Floats], rng: np.random.Generator) -> tuple[Floats, Floats, dict[str, Floats]]:
    """Friction that falls as a hyperbola of the logged temperature."""
    warm = 20 + 15 * (1 - np.exp(-m["t"] / 6))
    return 3 / (1 + (warm - 20) / 12) * np.sign(m["v"]), np.zeros(len(warm)), {"temperature_degC": warm}


def test_friction_falls_with_a_logged_temperature() -> None:
    finding = closed(lubricated)
    assert [found.id for found in finding.effects][:1] == ["warming"]
    assert finding.effects[0].parameters["fall_per_K"].value == pytest.approx(0.06, abs=0.03)


@pytest.mark.parametrize("column", ["pressure_bar", "load_1"])
def test_an_input_that_cannot_be_used_is_left_out_with_a_note(column: str) -> None:
    m = motion(1)
    columns = {"t_s": m["t"], "position_m": m["x"], "force_N": m["v"], column: np.where(m["t"] < 1, np.nan, 1.0)}
    read = record_of("run", columns, RIG)
    assert any(f"column {column} is left out" in note for note in read.notes)
    assert "load_1" not in read.columns
