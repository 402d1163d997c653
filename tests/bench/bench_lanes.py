"""What parameter sets side by side save: processor time of a predicted record, eight at once against one at a time.

`python -m tests.bench.bench_lanes` runs the magnetic and the pulled model over 45 s at 500 Hz, both ways in turn, and
prints the ratio and what compiling took.
"""

import time

import numpy as np

from models.assembly.model import assemble
from models.compiled.kernel import LANES, Kernel
from models.drives.magnetic import Magnetic
from models.drives.pull import Pull
from models.effects import CATALOGUE
from models.laws.geometry import Capsule, Tissue
from models.surfaces.gut import Wall

SAMPLES, DT_S = 22_500, 2e-3
ROUNDS = 5


def main() -> None:
    """Print a line a model."""
    command = 0.01 * np.sin(2 * np.pi * 0.05 * DT_S * np.arange(SAMPLES))
    for drive, substeps in ((Magnetic(), 8), (Pull(), 1)):
        for effects in ((), ("fold_periodic",), ("stribeck",)):
            model = assemble(Wall.around(Capsule(), Tissue()), drive, [CATALOGUE[name] for name in effects])
            kernel, p = Kernel(model.step, model.correct), model.vector({})
            alone, together = np.empty(SAMPLES), np.empty((SAMPLES, LANES))
            states, parameters = (np.repeat(v[:, None], LANES, axis=1) for v in (model.start(), p))
            began = time.process_time()
            kernel.many(states.copy(), command[:2], together, 0.0, parameters, 1, DT_S, together, 0.0)
            compiled = time.process_time() - began
            kernel.one(model.start(), command[:2], alone, 0.0, p, 1, DT_S, alone)
            ratios = []
            for _ in range(ROUNDS):
                began = time.process_time()
                kernel.one(model.start(), command, alone, 0.0, p, substeps, DT_S, alone)
                between = time.process_time()
                kernel.many(states.copy(), command, together, 0.0, parameters, substeps, DT_S, together, 0.0)
                ratios.append(LANES * (between - began) / (time.process_time() - between))
            name = f"{drive.name} {'+'.join(effects) or 'base'}"
            print(f"{name:24s} one / (eight / 8) = {np.median(ratios):.1f}; compiled or loaded in {compiled:.2f} s")


if __name__ == "__main__":
    main()
