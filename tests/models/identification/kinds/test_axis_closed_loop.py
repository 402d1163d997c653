"""An axis under feedback: its force holds the noise of its place, and the intervals must hold the truth all the same."""

import numpy as np

TRUTH = {"mass_kg": 2.0, "viscous_friction_N_s_per_m": 6.0, "coulomb_friction_N": 1.5, "offset_N": 0.4}
STEP_S, SUBSTEPS, SECONDS = 2e-3, 20, 16.0
SEEDS, LEAST = 20, 18


def loop(seed: int, noise_m: float) -> dict[str, np.ndarray]:
    """A PD loop along two swings and a filtered random walk of the reference; friction settled in steps of 0.1 ms."""
    rng = np.random.default_rng(seed)
    n = round(SECONDS / STEP_S)
    t = STEP_S * np.arange(n)
    a, b = rng.uniform(0.25, 0.35), rng.uniform(0.7, 0.9)
    reference = 0.06 * np.sin(2 * np.pi * a * t) + 0.02 * np.sin(2 * np.pi * b * t)
    mass, viscous, coulomb, offset = TRUTH.values()
    x = v = seen_before = 0.0
    seen, force = np.empty(n), np.empty(n)
    h = STEP_S / SUBSTEPS
    for k in range(n):
        seen[k] = x + noise_m * rng.standard_normal()
        speed = (seen[k] - seen_before) / STEP_S if k else 0.0
        seen_before = seen[k]
        force[k] = 600.0 * (reference[k] - seen[k]) - 20.0 * speed
        # what is logged is linear between its samples
        before = force[k - 1] if k else force[k]
        for j in range(SUBSTEPS) if k else ():
            push = before + (force[k] - before) * (j + 0.5) / SUBSTEPS - offset - viscous * v
            free, stop = v + h / mass * push, h / mass * coulomb
            v = np.sign(free) * max(abs(free) - stop, 0.0)
            x += h * v
        seen[k] = seen[k] if k == 0 else seen[k]
    return {"t_s": t, "position_m": seen, "force_N": force}
