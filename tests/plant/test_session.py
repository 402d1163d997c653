"""The plant step by step is the plant in one go; its instruments keep their rate, latency and noise, and their
faults.
"""

import math

import numpy as np
import pytest

from plant import layout as at
from plant.drives import TrueCoil, TrueMagnet, TruePull, TrueVibro
from plant.rig import Plant, Truth
from plant.sensing import Instrument, Reading
from plant.session import Instruments, Session

RIGS = {
    "magnetic": Truth(TrueMagnet()),
    "magnetic behind lag and play": Truth(
        TrueMagnet(),
        hidden={"actuator_lag": {"time_s": 0.1}, "carriage_backlash": {"width_m": 2e-3}, "stribeck": {"excess": 0.5}},
    ),
    "coil": Truth(TrueCoil()),
    "vibro": Truth(TrueVibro()),
}


def commands(kind: str, count: int) -> list[float]:
    """A command a tick: a rising wave, a switch for an inner mass."""
    k = np.arange(count)
    if kind == "vibro":
        return [float(on) for on in k % 8 < 4]
    return [
        float(c) for c in 8e-3 * (1 + 0.1 * np.sin(0.3 * k)) * np.minimum(k / 50, 1.0) * (400 if kind == "coil" else 1)
    ]


def run(session: Session, ticks: list[float], tick_s: float = 2e-3) -> list[Reading]:
    """All readings of a run, a command a tick."""
    return [r for k, c in enumerate(ticks, start=1) for r in session.advance(c, k * tick_s)]


@pytest.mark.parametrize("name", RIGS)
def test_steps_give_the_bits_of_one_go(name: str) -> None:
    """The loop's plant and `Plant.advance` over the same drive agree to the last bit."""
    session, whole = Session(RIGS[name]), Plant(RIGS[name])
    drive = []
    for k, command in enumerate(commands(name.split()[0], 200), start=1):
        drive.append(session.drive_values(command, 100)[:-1])
        session.advance(command, k * 2e-3)
    rows = whole.advance(np.append(np.concatenate(drive), session.command), 10)
    assert np.array_equal(np.concatenate(session.rows), rows)
    assert np.ptp(rows[:, at.O_X]) > 1e-4


def test_readings_do_not_depend_on_the_tick() -> None:
    """Where the command stays, fine and coarse ticks see the same readings."""
    coarse, fine = (run(Session(RIGS["magnetic"], seed=3, command=6e-3), [6e-3] * n, 0.5 / n) for n in (50, 500))
    by_channel = [sorted((r.channel, r.stamp_s, r.value) for r in readings) for readings in (coarse, fine)]
    assert by_channel[0] == by_channel[1]


def test_rates_latency_and_noise() -> None:
    """Localisation comes at 100 Hz, 8 ms late, 0.5 mm rms; the carriage's own at 500 Hz, exact."""
    session = Session(RIGS["magnetic"], seed=1)
    readings = run(session, commands("magnetic", 2000))
    place = [r for r in readings if r.channel == "position_m"]
    carriage = [r for r in readings if r.channel == "carriage_position_m"]
    assert len(place) == pytest.approx(400, abs=2)
    assert len(carriage) == pytest.approx(2000, abs=2)
    assert {round(r.arrives_s - r.stamp_s, 6) for r in place} == {0.008}
    rows = np.concatenate(session.rows)
    errors = [r.value - np.interp(r.stamp_s, rows[:, at.O_T], rows[:, at.O_X]) for r in place]
    assert np.std(errors) == pytest.approx(0.5e-3, rel=0.15)
    assert [r.value for r in carriage[1:]] == pytest.approx(commands("magnetic", 2000)[: len(carriage) - 1], abs=1e-12)


def test_faults_of_an_instrument_leave_the_rest_of_its_noise() -> None:
    """Gaps are empty, NaN spans NaN, outliers far off; other readings are those of the sound instrument."""
    sound = run(Session(RIGS["magnetic"], seed=5), [0.0] * 1000)
    broken = Instrument(gaps_s=(0.2, 0.3), nan_s=(1.0, 0.1), outlier_share=0.1)
    readings = run(Session(RIGS["magnetic"], Instruments(localisation=broken), seed=5), [0.0] * 1000)
    place = {r.stamp_s: r.value for r in readings if r.channel == "position_m"}
    truth = {r.stamp_s: r.value for r in sound if r.channel == "position_m"}
    assert not [t for t in place if 0.2 <= t < 0.5]
    assert all(math.isnan(v) == (1.0 <= t < 1.1) for t, v in place.items())
    differing = [t for t, v in place.items() if v != truth[t] and not math.isnan(v)]
    assert 0.03 < len(differing) / len(place) < 0.2


def test_hidden_sensor_effects_reach_the_readings() -> None:
    """A late and smoothed sensor lags behind a sound one."""
    ticks = commands("magnetic", 1000)
    quiet = Instruments(localisation=Instrument(std=0.0))
    hidden = {"sensor_delay": {"time_s": 0.05}, "sensor_scale": {"excess": 0.1}}
    sound, slow = (
        [r.value for r in run(Session(Truth(TrueMagnet(), hidden=h), quiet), ticks) if r.channel == "position_m"]
        for h in ({}, hidden)
    )
    assert np.asarray(slow[5:]) == pytest.approx(1.1 * np.asarray(sound[:-5]), abs=1e-9)


def test_bad_input_is_refused() -> None:
    """An imposed capsule, a time that has passed, an impossible instrument."""
    with pytest.raises(ValueError, match="free capsule"):
        Session(Truth(TruePull()))
    with pytest.raises(ValueError, match="until_s must lie after"):
        Session(RIGS["magnetic"]).advance(0.0, 0.0)
    with pytest.raises(ValueError, match="finite"):
        Session(RIGS["magnetic"]).advance(math.nan, 0.1)
    with pytest.raises(ValueError, match="missing_share"):
        Instrument(missing_share=2.0)
    with pytest.raises(ValueError, match="pairs"):
        Instrument(gaps_s=(1.0,))
