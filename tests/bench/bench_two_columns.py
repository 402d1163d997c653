"""What an accelerometer on a vibrating capsule in the gut shows beside slow images, and images alone do not.

`python -m tests.bench.bench_two_columns [--damping 0.1] [--seconds 3]` simulates two records with five images a second
(0.5 mm noise) and an accelerometer at 500 Hz (0.05 m/s2), of a rig whose inner mass's spring is damped more than the
rig file says, in another form than the catalogue's. It prints the validation cost, 1 for the noise, of fits without an
effect and with each of three, to the images alone and to both columns. `--write DIR` writes three records of it, with
both columns and with images alone, and the rig file, for `capsule close-loop`.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
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
from models.rigs.columns import ACCELERATION
from models.rigs.reader import parse_rig
from models.rigs.rig import Rig
from plant.experiments.examples import BELIEVED
from plant.experiments.scenario import Accelerometer, RunTable, Scenario, record_scenario, write_record
from plant.rig import Truth
from plant.sensing import Sensor
from plant.tables import Floats

CANDIDATES: Final = ("spring_damping", "stribeck", "viscous_drag")
IMAGES_HZ, IMAGES_STD_M, STD_M_S2 = 5.0, 0.5e-3, 0.05
HIDDEN: Final = {"spring_damping": {"damping_N_s_per_m": 0.1}}


def simulated(
    seconds: float, count: int, hidden: dict[str, dict[str, float]]
) -> tuple[dict[str, dict[str, object]], list[dict[str, Floats]], Truth]:
    """Tables of the rig file, columns of the records and truth of a vibrating capsule in the gut with `hidden`."""
    own = BELIEVED["vibro"]
    rig = replace(own.truth(np.random.default_rng(3)), hidden=hidden)
    tables = own.tables() | {"noise": {"position_std_m": IMAGES_STD_M, "acceleration_std_m_s2": STD_M_S2}}
    sensors = Sensor(IMAGES_HZ, IMAGES_STD_M), (Accelerometer(std_m_s2=STD_M_S2),)
    runs = [RunTable("", seconds, 7 + k, rig.step_s) for k in range(count)]
    return tables, [record_scenario(Scenario(run, own.kind, rig, own.profile, *sensors)) for run in runs], rig


def series(seconds: float, count: int = 2, **hidden: dict[str, float]) -> tuple[Rig, list[Record], Truth]:
    """Rig file, records and truth of a vibrating capsule in the gut, with the `hidden` effects."""
    tables, made, rig = simulated(seconds, count, hidden)
    belief, records = parse_rig(tables), []
    for k, columns in enumerate(made):
        rounded = {name: np.round(values, 9) for name, values in columns.items()}
        records.append(ready(record_of(f"run_{k}", rounded, belief), belief))
    return belief, records, rig


def write(folder: Path, seconds: float, **hidden: dict[str, float]) -> None:
    """Two records and a held-out one as files, each also with images alone, and the rig file."""
    tables, made, _ = simulated(seconds, 3, hidden)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(toml_text(tables))
    for name, columns in zip(("run_0", "run_1", "held"), made, strict=True):
        write_record(folder / f"{name}.csv.gz", columns)
        write_record(folder / f"images_{name}.csv.gz", {k: v for k, v in columns.items() if k != ACCELERATION})


def kind_of(rig: Rig, records: list[Record]) -> SeriesKind:
    """The kind with the candidates alone."""
    kind = kind_for(rig, records)
    assert isinstance(kind, SeriesKind)
    return replace(kind, effects=tuple(CATALOGUE[name] for name in CANDIDATES))


def cost(kind: SeriesKind, records: list[Record], effect: str = "") -> float:
    """What a fit with the `effect` leaves."""
    some = [effect] if effect else []
    start = kind.nominal().with_(effect, CATALOGUE[effect].start()) if effect else kind.nominal()
    return judged_cost(kind, records, Fitter.of(kind, records, some).far([start]).theta)


def rows(rig: Rig, records: list[Record]) -> Iterator[tuple[str, str, float]]:
    """Columns, effect and cost."""
    images = [record.without([ACCELERATION]) for record in records]
    for columns, some in (("images alone", images), ("both columns", records)):
        kind = kind_of(rig, some)
        for effect in ("", *CANDIDATES):
            yield columns, effect or "none", cost(kind, some, effect)


def main() -> None:
    """Print the costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--damping", type=float, default=0.1)
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--write", type=Path)
    options = parser.parse_args()
    if options.write:
        return write(options.write, options.seconds, spring_damping={"damping_N_s_per_m": options.damping})
    rig, records, _ = series(options.seconds, spring_damping={"damping_N_s_per_m": options.damping})
    for columns, effect, left in rows(rig, records):
        print(f"{columns}, {effect}: {left:.3g}", flush=True)


if __name__ == "__main__":
    main()
