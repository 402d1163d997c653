"""Made-up findings for the tests of the report and the command line."""

from dataclasses import replace

import numpy as np

from models.effects.equation import equations_of
from models.effects.friction import FoldPeriodic
from models.formula import Formula, called, equal
from models.identification.finding import (
    CandidateRow,
    Check,
    Dependence,
    Finding,
    Fitted,
    FoundEffect,
    Proposal,
    ResidualCurve,
    Separation,
    Trace,
)
from models.identification.residual_term import term_of


def trace(name: str, role: str, seed: int, seconds: float = 40.0) -> Trace:
    """A pull with a stick-slip saw on folds that only the augmented model knows."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 0.002)
    v = 0.004 * np.sign(np.sin(2 * np.pi * t / 13 + seed))
    x = np.cumsum(v) * 0.002
    saw = 0.035 * ((np.cumsum(np.abs(v)) * 0.002 / 0.00027) % 1.0)
    right = (0.055 + saw) * (1 + 0.2 * np.sin(2 * np.pi * x / 0.0073)) * np.sign(v)
    predicted = {
        "nominal": 1.15 * (0.055 + saw) * np.sign(v),
        "calibrated": (0.055 + saw) * np.sign(v),
        "augmented": right,
    }
    signals = {"t_s": t, "x_m": x, "v_m_s": v + 1e-4 * rng.standard_normal(len(t)), "force_N": right}
    return Trace(name, role, "t_s", t, right + 1e-3 * rng.standard_normal(len(t)), predicted, signals)


def pull_finding(verdict: str = "named", seconds: float = 40.0) -> Finding:
    """Folds found on a pull, or, with another verdict, the same without an effect."""
    folds = FoundEffect(
        "fold_periodic",
        ("peristaltic_wave",),
        {
            "depth": Fitted(0.201, (0.18, 0.22)),
            "wavelength_m": Fitted(0.0073, (0.0072, 0.0074), "m"),
            "phase_rad": Fitted(0.1, (float("nan"), float("nan")), "rad", identifiable=False),
        },
        41.2,
        0.993,
    )
    names = (
        "fold_periodic",
        "peristaltic_wave",
        "lumen_taper",
        "stenosis",
        "stribeck",
        "viscous_drag",
        "tissue_drying",
    )
    candidates = [
        CandidateRow(
            name,
            1,
            0.62 / (i + 1),
            41.2 / (i + 1) ** 2 if i < 4 else None,
            "added" if i == 0 else "fitted" if i < 4 else "screened only",
        )
        for i, name in enumerate(names)
    ]
    candidates += [
        CandidateRow(name, 2, 0.03 / i, 0.4 if i < 3 else None, "below the threshold")
        for i, name in enumerate(names)
        if i
    ]
    return Finding(
        kind="pull",
        quantity="force_N",
        unit="N",
        measure="rms error of the free-running prediction, low-passed at 2 Hz",
        columns=("force_N",),
        error_unit="N",
        verdict=verdict,
        effects=(folds,) if verdict == "named" else (),
        calibration={
            "hoop_factor": Fitted(0.93, (0.91, 0.95)),
            "friction_coefficient": Fitted(0.0764, (0.0741, 0.079)),
            "recovery_time_s": Fitted(0.05, (0.01, 0.2), "s", identifiable=False),
        },
        nominal={"hoop_factor": 1.0, "friction_coefficient": 0.082, "recovery_time_s": 0.05},
        error={
            "train": {"nominal": 0.0101, "calibrated": 0.0081, "augmented": 0.00083},
            "holdout": {"nominal": 0.0113, "calibrated": 0.0086, "augmented": 0.00091},
        },
        noise_floor=0.00075,
        checks=(
            Check("whiteness", "whiteness", 0.8, 1.0, True, "is what is left free of memory?"),
            Check(
                "whiteness_position", "goes with position", 1.7, 1.0, False, "does what is left go with the position?"
            ),
        ),
        candidates=tuple(candidates),
        smallest_detectable={"stribeck": 0.08, "viscous_drag": 0.004, "stenosis": float("nan")},
        next_experiment="reverse over the same positions: folds stay where they are, a wave travels on",
        statements=(
            "In 200 imitated records without an effect none reached this evidence.",
            "The recovery time cannot be told: the teeth blur.",
        ),
        equations=(
            [equal(Formula("m") * Formula("v'"), Formula("F_act") - called("F_e", np.abs(Formula("v"))))],
            ["folds of the gut: ", *equations_of(FoldPeriodic, {"depth": 0.201, "wavelength_m": 0.0073})],
        ),
        traces=(
            *(trace(f"train_{i}", "train", i, seconds) for i in (1, 2, 3)),
            trace("holdout", "holdout", 4, seconds),
        ),
        seconds=74.2,
        timings={"calibration": 21.0, "screening": 14.1, "fitting candidates": 33.0, "intervals": 6.1},
    )


def left_finding() -> Finding:
    """An unknown in which a wave over position is left."""
    x = np.linspace(0.0, 0.03, 40)
    values = 2e-3 + 3e-3 * np.sin(2 * np.pi * x / 7e-3 + 0.4)
    curve = ResidualCurve("x_m", "-v", 0.53, x, values, values - 2e-4, values + 2e-4)
    left = Dependence("force", "N", ("train_1",), (curve,), term=term_of(curve, "N", 0.05), level=0.05)
    return replace(pull_finding("unknown", seconds=5.0), dependence=left)


def table_finding() -> Finding:
    """Mean speeds over period and duty."""
    rng = np.random.default_rng(3)
    period, duty = (
        np.repeat(values.ravel(), 3) for values in np.meshgrid(np.linspace(0.03, 0.12, 9), (0.1, 0.2, 0.3, 0.5, 0.7))
    )
    speed = 0.04 * np.sin((period - 0.03) / 0.03) * (0.5 - duty)
    predicted = {"nominal": -0.6 * speed + 0.004, "calibrated": 0.7 * speed, "augmented": speed}
    measured = speed + 1e-3 * rng.standard_normal(len(speed))
    signals = {"period_s": period, "duty": duty}
    part = Trace("mean_velocity", "train", "row", np.arange(len(speed), dtype=float), measured, predicted, signals)
    base = pull_finding(seconds=2.0)
    speed_of = {"quantity": "mean_velocity_m_s", "columns": ("mean_velocity_m_s",), "unit": "m/s", "error_unit": "m/s"}
    return Finding(**{**base.__dict__, "kind": "vibro_table", **speed_of, "traces": (part,)})


def spectrum_finding() -> Finding:
    """Two moduli over frequency, three samples, nothing known explains what is left, nothing held out."""
    frequency = np.tile(np.array([20.0, 30.0, 40.0, 50.0, 60.0]), 3)
    right = np.column_stack((5e5 + 3e3 * frequency, 4e5 + 4e3 * frequency))
    predicted = {"nominal": 0.01 * right, "calibrated": 1.05 * right, "augmented": 1.05 * right}
    measured = right * (1 + 0.1 * np.random.default_rng(5).standard_normal(right.shape))
    signals = {"frequency_Hz": frequency, "sample": np.repeat([1.0, 2.0, 3.0], 5)}
    part = Trace("viscoelastic_table2_dma", "train", "frequency_Hz", frequency, measured, predicted, signals)
    base = pull_finding("unknown", seconds=2.0)
    numbers = {"nominal": 99.1, "calibrated": 14.2, "augmented": 14.2}
    changed = {
        "kind": "dma",
        "quantity": "storage_modulus_Pa and loss_modulus_Pa",
        "unit": "Pa",
        "measure": "norm of the error of the complex modulus, relative to the norm of the modulus",
        "columns": ("storage_modulus_Pa", "loss_modulus_Pa"),
        "error_unit": "%",
        "error": {"train": numbers, "holdout": {}},
        "noise_floor": float("nan"),
        "traces": (part,),
        "candidates": (),
        "next_experiment": None,
    }
    return Finding(**{**base.__dict__, **changed})


def proposal() -> Proposal:
    """There and back over 8 mm in 10 s, which tells folds from a wave."""
    times, places = np.array([0.0, 0.3, 4.3, 6.3, 10.0]), 1e-3 * np.array([2.0, 2.0, 10.0, 10.0, 2.5])
    t = 2e-3 * np.arange(5001)
    motion = {"t_s": t, "carriage_position_m": np.interp(t, times, places)}
    apart = Separation("fold_periodic", "peristaltic_wave", 12.4, "train_2", 0.7)
    return Proposal("carriage_position_m", times, places, motion, (apart,))
