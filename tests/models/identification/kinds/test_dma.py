"""A dynamic shear test: published errors of the five elements, a common residual, a bound for every law."""

import csv

import numpy as np
import pytest
from scipy.optimize import least_squares

from models.effects.wall import BroadRelaxation
from models.formula import line_text
from models.identification.kinds.dma import COLUMNS, DmaKind, moduli_of, samples_of
from models.identification.kinds.reports import dma as report
from models.identification.kinds.reports.dma import best_relaxation, common_residual, springpot_alone
from models.parameter import SETS
from models.records.record import Record
from models.rigs.reader import parse_rig
from models.theta import Theta

KIND = DmaKind.from_rig(parse_rig({"rig": {"kind": "dma"}}))
BROAD = Theta.of({("broad_relaxation", "stiffness_Pa"): 1e5, ("broad_relaxation", "exponent"): 0.3})


def measured() -> Record:
    with (SETS / "measured" / "viscoelastic_table2_dma.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return Record("paper V Table 2", "dma", {c: np.array([float(r[c]) for r in rows]) for c in rows[0]})


def fitted(records: list[Record], theta: Theta) -> Theta:
    limits = {p.name: p for p in KIND.base} | {("broad_relaxation", p.name): p for p in BroadRelaxation.parameters()}
    names = list(theta)

    def misfit(q: np.ndarray) -> np.ndarray:
        return np.concatenate([KIND.residual(r, Theta.of(zip(names, q, strict=True))) for r in records])

    bounds = ([limits[n].lower for n in names], [limits[n].upper for n in names])
    q = least_squares(misfit, list(theta.values()), bounds=bounds, x_scale=[max(abs(v), 0.3) for v in theta.values()]).x
    return Theta.of(zip(names, map(float, q), strict=True))


def error(records: list[Record], theta: Theta) -> float:
    return KIND.error(records, [KIND.predict(r, theta) for r in records])


@pytest.fixture(scope="module")
def calibrated() -> Theta:
    return fitted([measured()], KIND.nominal())


def test_nominal_moduli_are_the_paper_s_and_miss_by_99_percent() -> None:
    moduli = moduli_of(KIND.nominal())
    assert pytest.approx(6617.4) == moduli.E2
    assert moduli.eta2 == pytest.approx(312.2)
    assert error([measured()], KIND.nominal()) == pytest.approx(99.2, abs=0.1)


def test_five_elements_leave_fourteen_percent_and_fifteen_left_out(calibrated: Theta) -> None:
    assert error([measured()], calibrated) == pytest.approx(14.2, abs=0.1)
    left = [error(validation, fitted(training, calibrated)) for training, validation in KIND.splits([measured()])]
    assert np.sqrt(np.mean(np.square(left))) == pytest.approx(14.6, abs=0.3)


def test_a_broad_spectrum_is_no_better(calibrated: Theta) -> None:
    record = measured()
    assert springpot_alone(KIND, [record], [record]) == pytest.approx(14.6, abs=0.1)
    folds = KIND.splits([record])
    left = [springpot_alone(KIND, training, validation) for training, validation in folds]
    assert np.sqrt(np.mean(np.square(left))) == pytest.approx(15.0, abs=0.2)
    both = [error(validation, fitted(training, Theta.of({**calibrated, **BROAD}))) for training, validation in folds]
    assert np.sqrt(np.mean(np.square(both))) > 14.2
    assert best_relaxation(KIND, [record]) == pytest.approx(13.9, abs=0.1)


def test_what_remains_is_common_to_the_samples_and_dips_at_40_hertz(calibrated: Theta) -> None:
    common = common_residual(KIND, [measured()], calibrated)
    assert common is not None
    assert common.p < 1e-10
    assert common.p_permuted < 0.002
    assert common.share > 0.9
    assert common.frequency_Hz[np.argmin(common.storage)] == 40.0
    assert common.storage.min() == pytest.approx(-0.2, abs=0.03)
    words = " ".join(report.statements(KIND, {"calibrated": calibrated}, [measured()]))
    for piece in ("common to the samples", "40 Hz", "No known effect explains it", "no better", "not what is missing"):
        assert piece in words


def test_noise_alone_is_not_called_common(calibrated: Theta) -> None:
    rng = np.random.default_rng(2)
    chances, chi = [], []
    for _ in range(30):
        record = KIND.imitate(measured(), calibrated, rng)
        common = common_residual(KIND, [record], calibrated, permutations=20)
        assert common is not None
        chances.append(common.p)
        chi.append(np.mean(KIND.residual(record, calibrated) ** 2))
    assert np.mean(np.array(chances) < 0.05) < 0.2
    assert np.mean(chi) == pytest.approx(1.0, abs=0.25)
    assert common_residual(KIND, [measured().rows(slice(0, 5))], calibrated) is None


def test_scatter_of_the_samples_is_the_noise_floor() -> None:
    assert KIND.noise_floor([measured()]) == pytest.approx(3.7, abs=0.1)
    assert KIND.noise_floor([measured().rows(slice(0, 5))]) == pytest.approx(3.8, abs=0.1)


def test_folds_go_by_sample_and_a_single_sample_by_frequency() -> None:
    record = measured()
    assert [len(v[0]) for _, v in KIND.splits([record])] == [5, 5, 5]
    assert all(len(np.unique(v[0]["sample"])) == 1 for _, v in KIND.splits([record]))
    single = record.rows(samples_of(record)[0])
    assert [len(v[0]) for _, v in KIND.splits([single])] == [1, 1, 1, 1, 1]


def test_springpot_has_its_angle_and_power() -> None:
    modulus = BroadRelaxation().modulus(np.array([10.0, 40.0]), {"stiffness_Pa": 2e5, "exponent": 0.5})
    assert modulus.storage == pytest.approx(modulus.loss)
    assert np.hypot(modulus.storage, modulus.loss) == pytest.approx([2e5, 4e5])
    zero = KIND.predict(measured(), KIND.nominal() | BROAD | {("broad_relaxation", "stiffness_Pa"): 0.0})
    assert zero == pytest.approx(KIND.predict(measured(), KIND.nominal()))


def test_words_and_signals_cover_the_model(calibrated: Theta) -> None:
    assert "i omega" in line_text(report.equations(KIND, calibrated)[0])
    assert "(i f/f_0)^0.3" in " ".join(map(line_text, report.equations(KIND, Theta.of({**calibrated, **BROAD}))))
    assert "elastic reference" in str(report.next_experiment(KIND, calibrated, [measured()], {}))
    assert list(KIND.signals(measured())["sample"][:6]) == [1, 1, 1, 1, 1, 2]


def three_decades(samples: int = 3) -> Record:
    """A springpot beside a spring, as a polymer is, from 0.1 to 100 Hz, each sample with its own factor."""
    frequency = np.tile(np.logspace(-1, 2, 16), samples)
    sample = np.repeat(np.arange(samples), 16)
    law = BroadRelaxation().modulus(frequency, {"stiffness_Pa": 3e5, "exponent": 0.3})
    rng, scale = np.random.default_rng(4), 1 + 0.02 * np.arange(samples)
    storage, loss = (
        part * scale[sample] * (1 + 0.005 * rng.standard_normal(len(part))) for part in (law.storage + 1e5, law.loss)
    )
    columns = {"frequency_Hz": frequency, "sample": sample.astype(float)}
    return Record("polymer", "dma", {**columns, COLUMNS[0]: storage, COLUMNS[1]: loss})


def test_words_follow_from_the_record_of_three_decades() -> None:
    record = three_decades()
    theta = fitted([record], KIND.nominal())
    words = " ".join(report.statements(KIND, {"calibrated": theta}, [record]))
    for piece in (
        "The frequencies span 3 decades, 0.1 to 100 Hz",
        "a broader spectrum is all that is missing",
        "better",
    ):
        assert piece in words
    for piece in ("dips", "not what is missing", "no better", "No known effect"):
        assert piece not in words
    experiment = str(report.next_experiment(KIND, theta, [record], {}))
    assert "30 and 60" not in experiment
    assert "Hz" in experiment


def test_moduli_at_a_bound_are_said(calibrated: Theta) -> None:
    stopped = Theta.of({**calibrated, "log10_E3": KIND.base[2].lower, "log10_tau2": KIND.base[4].upper})
    words = " ".join(report.statements(KIND, {"calibrated": stopped}, [measured()]))
    assert "The calibrated fit stops at bounds: E3 at 1 Pa and tau2 at 100 s." in words
    words = " ".join(report.statements(KIND, {"calibrated": KIND.nominal()}, [measured()]))
    assert "stops at bounds" not in words
