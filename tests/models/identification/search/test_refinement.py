"""Finer shapes that only the final stage shows: taken where they, and not a luckier base, bring a fit to the noise."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from models.effects import CATALOGUE
from models.effects.force import PeristalticWave
from models.identification.fitting.fit import Fit
from models.identification.kind import Array, Kind
from models.identification.search.refinement import refined_at_last
from models.identification.settings import SET
from models.parameter import Parameter
from models.records.record import Record
from models.theta import Theta

SAMPLES, SLOW = 4000, 40
_RNG = np.random.default_rng(3)
NOISE = _RNG.standard_normal(SAMPLES)
SHAPE, LEVEL, STRANGE = np.repeat(_RNG.standard_normal((3, SAMPLES // SLOW)), SLOW, axis=1)
RECORDS = [Record("r", "magnetic", {"t_s": np.linspace(0.0, 40.0, SAMPLES)})]


def _slow(signal: Array) -> float:
    """Rms of what is slow in a signal."""
    return float(np.sqrt(np.mean(signal.reshape(-1, SLOW).mean(axis=1) ** 2)))


class _Seen(Kind):
    """A linear world, of which what is slow is reported: noise, a shape that the last stage alone shows, the base's own
    number, and something that nothing explains.
    """

    name, criteria, final, judges = "magnetic", 2, 2, (1,)
    base = (Parameter("level", 1.0, "1", 0.0, 2.0, "test", fit=True),)
    effects = (PeristalticWave,)

    quantity = unit = measure = "position_m"
    imitate = signals = splits = columns = NotImplemented
    catalogue = CATALOGUE

    def __init__(self, shape: float, strange: float) -> None:
        self.shape, self.strange = shape, strange

    def residual(self, record: Record, theta: Theta, stage: int = 0) -> Array:
        shown = self.shape - 5 * theta.get(("wave_harmonics", "fifth_sin"), 0.0)
        seen = (
            NOISE
            + (stage == self.final) * (shown * SHAPE + self.strange * STRANGE)
            + (theta.get("level", 1.0) - 1.0) * LEVEL
        )
        return np.asarray(seen)

    def predict(self, record: Record, theta: Theta) -> Array:
        return self.residual(record, theta, self.final)

    def error(self, records: Sequence[Record], predictions: Sequence[Array]) -> float:
        return _slow(predictions[0])

    def noise_floor(self, records: Sequence[Record]) -> float:
        return _slow(NOISE)


def _begun(kind: _Seen, level: float) -> Fit:
    r = kind.residual(RECORDS[0], Theta({"level": level}), kind.final)
    return Fit(Theta({"level": level}), float(r @ r), len(r), np.zeros((len(r), 1)), r)


def _taken(kind: Any, level: float) -> tuple[Sequence[str], float]:
    added, fit = refined_at_last(kind, RECORDS, ["peristaltic_wave"], [], _begun(kind, level), {})
    return added, fit.chi2


def test_a_shape_that_only_the_final_stage_shows_is_taken() -> None:
    added, chi2 = _taken(_Seen(shape=0.4, strange=0.0), level=1.0)
    assert added == ["wave_harmonics"]
    assert chi2 == pytest.approx(1.0, abs=0.03)


def test_a_shape_that_the_reported_error_alone_tells_is_taken() -> None:
    kind = _Seen(shape=0.15, strange=0.0)
    added, chi2 = _taken(kind, level=1.0)
    assert _begun(kind, 1.0).chi2 < chi2 / (1 - SET.finer_gain)
    assert added == ["wave_harmonics"]


def test_a_fit_at_the_noise_is_left_alone() -> None:
    assert _taken(_Seen(shape=0.0, strange=0.0), level=1.0)[0] == []


def test_a_shape_that_leaves_more_than_the_noise_is_not_taken() -> None:
    assert _taken(_Seen(shape=0.4, strange=1.0), level=1.0)[0] == []


def test_a_better_base_is_no_merit_of_a_shape() -> None:
    added, chi2 = _taken(_Seen(shape=0.0, strange=0.0), level=1.4)
    assert added == []
    assert chi2 == pytest.approx(1.0, abs=0.03)


def test_a_kind_with_one_stage_hides_no_shape_from_its_search() -> None:
    kind: Any = _Seen(shape=0.4, strange=0.0)
    kind.criteria, begun = 1, _begun(kind, 1.4)
    added, fit = refined_at_last(kind, RECORDS, ["peristaltic_wave"], [], begun, {})
    assert not added
    assert fit is begun
