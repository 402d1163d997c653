"""Sensors: rate, noise, rounding, delay, low-pass, and the hidden sensor effects."""

import numpy as np
import pytest

from plant.hidden.table import effect_table
from plant.sensing import Sensor

T = np.linspace(0.0, 10.0, 50_001)


def test_rate_and_plain_reading(rng: np.random.Generator) -> None:
    when, y = Sensor(rate_Hz=125.0).measure(T, np.sin(T), rng)
    assert np.diff(when) == pytest.approx(1 / 125)
    assert y == pytest.approx(np.sin(when), abs=1e-8)


def test_noise_is_white_and_of_its_size(rng: np.random.Generator) -> None:
    _, y = Sensor(rate_Hz=5000.0, noise_std=2e-3).measure(T, np.zeros_like(T), rng)
    assert np.std(y) == pytest.approx(2e-3, rel=0.02)
    assert abs(np.corrcoef(y[1:], y[:-1])[0, 1]) < 0.02


def test_quantised_readings_are_whole_steps(rng: np.random.Generator) -> None:
    when, y = Sensor(quantum=0.05).measure(T, np.sin(T), rng)
    assert y / 0.05 == pytest.approx(np.round(y / 0.05), abs=1e-9)
    assert np.max(np.abs(y - np.sin(when))) <= 0.025 + 1e-7


def test_delay_shifts_and_holds_the_first_value(rng: np.random.Generator) -> None:
    when, y = Sensor(delay_s=0.3).measure(T, 1 + T, rng)
    assert y == pytest.approx(1 + np.maximum(when - 0.3, 0.0), abs=1e-9)


def test_low_pass_lags_a_ramp_by_its_time_constant(rng: np.random.Generator) -> None:
    when, y = Sensor(lowpass_s=0.2).measure(T, T, rng)
    assert y == pytest.approx(when - 0.2 * (1 - np.exp(-when / 0.2)), abs=1e-9)


def test_low_pass_keeps_a_constant_exactly(rng: np.random.Generator) -> None:
    _, y = Sensor(lowpass_s=0.7).measure(T, np.full_like(T, 3.0), rng)
    assert y == pytest.approx(3.0, abs=1e-12)


@pytest.mark.parametrize(
    "name", ["sensor_drift", "sensor_bias", "sensor_scale", "sensor_delay", "sensor_lowpass", "mains_hum"]
)
def test_hidden_sensor_effects_change_the_reading(name: str, rng: np.random.Generator) -> None:
    truth = np.sin(T)
    _, plain = Sensor().measure(T, truth, rng, effect_table({}))
    _, hit = Sensor().measure(T, truth, rng, effect_table({name: {}}))
    assert np.max(np.abs(hit - plain)) > 0.02


@pytest.mark.parametrize(
    ("field", "value"), [("rate_Hz", 0.0), ("noise_std", -1.0), ("delay_s", -0.1), ("quantum", np.nan)]
)
def test_bad_numbers_are_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{field} must (be|lie in)"):
        Sensor(**{field: value})
