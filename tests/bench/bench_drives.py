"""The loop on coil and vibro time series, with a hidden effect and without: what is named, errors against the floor,
seconds.

`python -m tests.bench.bench_drives [--rig coil vibro_plate vibro_gut] [--effect none spring_damping] [--seed 1]
[--seconds 12]` makes three training records and one held out of a rig whose numbers are off by up to 15 %, closes the
loop and prints a line a series. `--truth` prints instead what the model leaves at the plant's own numbers, for finer
and finer steps of the plant.
"""

import argparse
import time
from dataclasses import replace

import numpy as np

from models.identification import close
from models.identification.kinds import kind_for
from models.identification.kinds.series.drive_input import SWITCH_DELAY
from models.laws.geometry import Capsule, Tissue
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig as Belief
from plant.drives import TrueCoil, TrueVibro
from plant.experiments.profile import RandomPulses, RandomVoltage
from plant.experiments.scenario import RunTable, Scenario, record_scenario
from plant.rig import TruePlate, Truth
from plant.sensing import Sensor
from tests.plant.series import draw

RIGS = ("coil", "vibro_plate", "vibro_gut")
NOISE_M = 5e-5


def believed(name: str) -> dict[str, dict[str, object]]:
    """The nominal rig file."""
    tissue = {f: getattr(Tissue(), f) for f in Tissue.__dataclass_fields__}
    gut: dict[str, object] = {"preset": "jejunum", **tissue}
    body: dict[str, object] = {
        "radius_m": 6.5e-3,
        "cylinder_length_m": 20e-3,
        "mass_kg": 4e-3 if name == "coil" else 0.02,
    }
    noise: dict[str, object] = {"position_std_m": NOISE_M}
    if name == "coil":
        head = {"kind": "coil", "force_constant_N_per_A": 0.5, "coil_resistance_Ohm": 10.0, "coil_inductance_H": 0.01}
        return {"capsule": body, "tissue": gut, "rig": head, "noise": noise}
    inner, k, c, force = (0.074, 256.23, 0.3, 1.25) if name == "vibro_plate" else (0.01, 150.0, 0.3, 0.3)
    drive: dict[str, object] = {
        "inner_mass_kg": inner,
        "spring_stiffness_N_per_m": k,
        "spring_damping_N_s_per_m": c,
        "force_N": force,
        "reaction_on_body": True,
    }
    both: dict[str, dict[str, object]] = {"drive": drive, "rig": {"kind": "vibro"}, "noise": noise}
    if name == "vibro_plate":
        return both | {"capsule": {"mass_kg": 0.193}, "surface": {"kind": "plate", "friction_coefficient": 0.29}}
    return both | {"capsule": body, "tissue": gut, "surface": {"kind": "gut"}}


def series(
    name: str,
    effect: str | None,
    seed: int,
    seconds: float,
    count: int = 4,
    step_s: float = 2e-5,
    by_voltage: bool = False,
) -> tuple[Belief, list[Record], dict[str, float]]:
    """Rig file, records and the true base parameters. `by_voltage`: the coil's current is not logged."""
    rng = np.random.default_rng(seed)
    off = {
        "mu": rng.uniform(0.85, 1.15),
        "hoop": rng.uniform(0.85, 1.15),
        "k": rng.uniform(0.93, 1.07),
        "f": rng.uniform(0.93, 1.07),
    }
    belief = parse_rig(believed(name))
    mu = (0.29 if name == "vibro_plate" else Tissue().friction_coefficient) * off["mu"]
    hidden = {} if effect is None else {effect: draw(effect, rng)}
    truth = {"friction_coefficient": mu}
    common = {"hidden": hidden, "step_s": step_s}
    if belief.drive is None:
        drive = TrueCoil(0.5 * off["f"], 10.0, 0.01, 1.0, 0.0)
        # type: ignore[arg-type]
        rig = Truth(drive, tissue=Tissue(friction_coefficient=mu), hoop_factor=off["hoop"], **common)
        truth |= {"hoop_stress_factor": off["hoop"], "coil_force_N_per_A": drive.gain_N_per_A}
    else:
        d = belief.drive
        vibro = TrueVibro(
            d.inner_mass_kg, d.spring_stiffness_N_per_m * off["k"], d.spring_damping_N_s_per_m, d.force_N * off["f"]
        )
        truth |= {"force_N": vibro.force_N, "spring_stiffness_N_per_m": vibro.spring_stiffness_N_per_m}
        if name == "vibro_plate":
            rig = Truth(vibro, Capsule(mass_kg=0.193), surface=TruePlate(mu), **common)  # type: ignore[arg-type]
        else:
            # type: ignore[arg-type]
            rig = Truth(
                vibro, Capsule(mass_kg=0.02), Tissue(friction_coefficient=mu), hoop_factor=off["hoop"], **common
            )
            truth |= {"hoop_stress_factor": off["hoop"]}
    profile = RandomVoltage() if name == "coil" else RandomPulses(0.08 if name == "vibro_plate" else 0.055)
    records = []
    for i in range(count):
        columns = record_scenario(
            Scenario(RunTable("", seconds, 1000 * seed + i), belief.kind, rig, profile, Sensor(500.0, NOISE_M))
        )
        if by_voltage:
            del columns["coil_current_A"]
        records.append(Record(f"{name}_{i + 1}", belief.kind, columns))
    return belief, records, truth


def at_the_truth(name: str, seed: int, seconds: float) -> None:
    """What the model leaves at the plant's own numbers."""
    for step_s in (2e-5, 5e-6, 2.5e-6):
        rig, records, truth = series(name, None, seed, seconds, 1, step_s)
        kind = kind_for(rig, records)
        theta = kind.nominal() | truth | ({SWITCH_DELAY: 0.0} if rig.kind == "vibro" else {})
        began = time.monotonic()
        left = kind.error(records, [kind.predict(records[0], theta)])
        took = time.monotonic() - began
        nominal = kind.error(records, [kind.predict(records[0], kind.nominal())])
        size = float(np.mean(kind.residual(records[0], theta, 2) ** 2))
        print(
            f"{name:12} seed {seed} plant's step {step_s:.2g} s: {left:.3g} m at the truth, {nominal:.3g} m nominal, "
            f"floor {kind.noise_floor(records):.3g} m; free run leaves {size:.3g} x the noise's variance; {took:.2f} s",
            flush=True,
        )


def run(name: str, effect: str | None, seed: int, seconds: float, by_voltage: bool) -> None:
    """One series made, closed and printed."""
    rig, records, _ = series(name, effect, seed, seconds, by_voltage=by_voltage)
    records = [replace(record, name=f"{record.name}_{i}") for i, record in enumerate(records)]
    finding, model = close(rig, records[:3], records[3:], lambda *_: None)
    errors = finding.error["holdout"]
    predicted = model.predict(rig, records[3])[finding.quantity]
    again = float(np.sqrt(np.mean((predicted - records[3][finding.quantity]) ** 2)))
    named = {
        e.id: [f"{k} {v.value:.3g}" for k, v in e.parameters.items()] + list(e.equivalent) for e in finding.effects
    }
    print(
        f"{name:12} {effect!s:20} seed {seed} {finding.verdict:8} {named} held out {errors['nominal']:.3g} ->"
        f" {errors['calibrated']:.3g} -> {errors['augmented']:.3g} m (floor {finding.noise_floor:.2g}), model file's"
        f" rms {again:.3g} m, {finding.seconds:.0f} s; {finding.statements[0]}"
        f" {[(c.id, c.gain) for c in finding.candidates if c.gain is not None]}",
        flush=True,
    )


def main() -> None:
    """Every rig with every effect that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rig", nargs="*", choices=RIGS, default=RIGS)
    parser.add_argument("--effect", nargs="*", default=["none"])
    parser.add_argument("--seed", nargs="*", type=int, default=[1])
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--by-voltage", action="store_true", help="coil rigs: the current is not logged")
    parser.add_argument("--truth", action="store_true")
    asked = parser.parse_args()
    for name in asked.rig:
        for seed in asked.seed:
            if asked.truth:
                at_the_truth(name, seed, asked.seconds)
                continue
            for effect in asked.effect:
                run(name, None if effect == "none" else effect, seed, asked.seconds, asked.by_voltage)


if __name__ == "__main__":
    main()
