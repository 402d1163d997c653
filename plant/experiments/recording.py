"""Run a scenario and return what its instruments saw, in the columns of a record."""

import numpy as np

from plant import layout as at
from plant.experiments.profile import Pwm
from plant.experiments.scenario import Scenario
from plant.rig import Plant
from plant.tables import Floats

_FASTEST_ROWS = 10  # steps between the truth's samples at most


def record_scenario(scenario: Scenario, rng: np.random.Generator | None = None) -> dict[str, Floats]:
    """Columns of interfaces.md for the rig's kind: time, what is driven, what is measured; `drive_on` is the share of
    the time since the last sample. Profile and sensor draw from streams of the scenario's seed, or from `rng` where
    given. Raises `ValueError` when the drive's values are not usable.
    """
    dt, seeds = scenario.rig.step_s, np.random.SeedSequence(scenario.run.seed).spawn(2)
    first, second = (rng or np.random.default_rng(seed) for seed in seeds)
    drive = scenario.profile.values(scenario.run.duration_s, dt, first)
    truth = scenario.rig.drive
    switched = isinstance(scenario.profile, Pwm)
    plant = Plant(scenario.rig)
    finest = 1 if rng is None else _FASTEST_ROWS
    every = int(np.clip(0.25 / (scenario.sensor.rate_Hz * dt), finest, _FASTEST_ROWS))
    rows = plant.advance(drive * truth.command_scale if switched else drive, every)
    measured = rows[:, truth.measured]
    t, reading = scenario.sensor.measure(rows[:, at.O_T], measured, second, plant.effects)
    times = dt * np.arange(drive.size)
    sums = np.interp(t, times, np.concatenate([[0.0], np.cumsum(drive[:-1]) * dt]))
    taken = {
        "reading": reading,
        "commanded": np.interp(t, times, drive),
        "mean": np.append(drive[0], np.diff(sums) / np.diff(t)),
        "current": np.interp(t, rows[:, at.O_T], rows[:, at.O_CURRENT]),
    }
    columns = {name: taken[what] for name, what in truth.columns().items()}
    if "drive_on" in columns and not switched:
        columns = {"drive_force_N" if name == "drive_on" else name: values for name, values in columns.items()}
    return {"t_s": t, **columns}
