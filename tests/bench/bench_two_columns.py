"""What a further measured column shows beside slow images, and images alone do not.

`python -m tests.bench.bench_two_columns [--rig vibro] [--seconds 3]` simulates two records of a rig with a hidden
effect in another form than the catalogue's:

- `vibro`: a vibrating capsule in the gut whose inner mass's spring is damped more than the rig file says, five images a
  second (0.5 mm noise) and an accelerometer at 500 Hz (0.05 m/s2);
- `magnetic_plate`, `coil_plate`: a capsule on a plate whose drive's grip fades, twenty images a second (0.2 mm noise)
  and a load cell between drive and capsule at 100 Hz (1 mN).

It prints the validation cost, 1 for the noise, of fits without an effect and with each of three, to the images alone
and to both columns. `--write DIR` writes three records of it, with both columns and with images alone, and the rig
file, for `capsule close-loop`.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from models.effects import CATALOGUE
from models.files.toml import toml_text
from models.identification.fitting.fit import judged_cost
from models.identification.fitting.fitter import Fitter
from models.identification.kinds import kind_for, ready
from models.identification.kinds.series.series import SeriesKind
from models.records.record import Record, record_of
from models.rigs.columns import FURTHER
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from plant.experiments.examples import BELIEVED
from plant.experiments.scenario import (
    Accelerometer,
    Instrument,
    LoadCell,
    RunTable,
    Scenario,
    record_scenario,
    write_record,
)
from plant.rig import Truth
from plant.sensing import Sensor
from plant.tables import Floats

Hidden = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Bench:
    """An example rig with its images and a further instrument, whose noise is `std`; what is hidden, what is tried."""

    example: str
    images: Sensor
    instrument: Instrument
    std: float
    hidden: Hidden
    candidates: tuple[str, ...]
    seconds: float


VIBRO: Final = Bench(
    "vibro",
    Sensor(5.0, 0.5e-3),
    Accelerometer(std_m_s2=0.05),
    0.05,
    {"spring_damping": {"damping_N_s_per_m": 0.1}},
    ("spring_damping", "stribeck", "viscous_drag"),
    3.0,
)
MAGNET, COIL = (
    Bench(
        example,
        Sensor(20.0, 0.2e-3),
        LoadCell(rate_Hz=100.0, std_N=1e-3),
        1e-3,
        {"coupling_fade": {"share": share, "time_s": 0.5 * seconds}},
        ("coupling_fade", "tissue_drying", "preconditioning"),
        seconds,
    )
    for example, share, seconds in (("magnetic_plate", 0.4, 16.0), ("coil_plate", 0.3, 16.0))
)
BENCHES: Final = {bench.example: bench for bench in (VIBRO, MAGNET, COIL)}


def simulated(
    bench: Bench, seconds: float, count: int, hidden: Hidden
) -> tuple[dict[str, dict[str, object]], list[dict[str, Floats]], Truth]:
    """Tables of the rig file, columns of the records and truth of a rig with `hidden`."""
    own, further = BELIEVED[bench.example], FURTHER[bench.instrument.column]
    rig = replace(own.truth(np.random.default_rng(3)), hidden=hidden)
    tables = own.tables() | {"noise": {"position_std_m": bench.images.noise_std, further.key("std"): bench.std}}
    runs = [RunTable("", seconds, 7 + k, rig.step_s) for k in range(count)]
    scenarios = [Scenario(run, own.kind, rig, own.profile, bench.images, (bench.instrument,)) for run in runs]
    return tables, [record_scenario(scenario) for scenario in scenarios], rig


def series(
    seconds: float, count: int = 2, bench: Bench = VIBRO, hidden: Hidden | None = None
) -> tuple[Rig, list[Record], Truth]:
    """Rig file, records and truth of a rig with the `hidden` effects, else the bench's."""
    tables, made, rig = simulated(bench, seconds, count, bench.hidden if hidden is None else hidden)
    belief, records = parse_rig(tables), []
    for k, columns in enumerate(made):
        rounded = {name: np.round(values, 9) for name, values in columns.items()}
        records.append(ready(record_of(f"run_{k}", rounded, belief), belief))
    return belief, records, rig


def write(folder: Path, bench: Bench, seconds: float) -> None:
    """Two records and a held-out one as files, each also with images alone, and the rig file."""
    tables, made, _ = simulated(bench, seconds, 3, bench.hidden)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(toml_text(tables))
    for name, columns in zip(("run_0", "run_1", "held"), made, strict=True):
        write_record(folder / f"{name}.csv.gz", columns)
        alone = {key: values for key, values in columns.items() if key != bench.instrument.column}
        write_record(folder / f"images_{name}.csv.gz", alone)


def kind_of(rig: Rig, records: list[Record], candidates: tuple[str, ...] = VIBRO.candidates) -> SeriesKind:
    """The kind with the candidates alone."""
    kind = kind_for(rig, records)
    assert isinstance(kind, SeriesKind)
    return replace(kind, effects=tuple(CATALOGUE[name] for name in candidates))


def cost(kind: SeriesKind, records: list[Record], effect: str = "") -> float:
    """What a fit with the `effect` leaves."""
    some = [effect] if effect else []
    start = kind.nominal().with_(effect, CATALOGUE[effect].start()) if effect else kind.nominal()
    return judged_cost(kind, records, Fitter.of(kind, records, some).far([start]).theta)


def rows(bench: Bench, seconds: float) -> Iterator[tuple[str, str, float]]:
    """Columns, effect and cost."""
    rig, records, _ = series(seconds, bench=bench)
    images = [record.without([bench.instrument.column]) for record in records]
    for columns, some in (("images alone", images), ("both columns", records)):
        kind = kind_of(rig, some, bench.candidates)
        for effect in ("", *bench.candidates):
            yield columns, effect or "none", cost(kind, some, effect)


def main() -> None:
    """Print the costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rig", choices=BENCHES, default=VIBRO.example)
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--write", type=Path)
    options = parser.parse_args()
    bench = BENCHES[options.rig]
    seconds = options.seconds or bench.seconds
    if options.write:
        return write(options.write, bench, seconds)
    for columns, effect, left in rows(bench, seconds):
        print(f"{columns}, {effect}: {left:.3g}", flush=True)


if __name__ == "__main__":
    main()
