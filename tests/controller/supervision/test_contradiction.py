"""What sensor and drive say alone: told apart from what cannot be, and left alone where it can."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from controller.limits import Envelope, Limits
from controller.supervision.breakaway import Resistance
from controller.supervision.contradiction import CONTRADICT, FREE, Contradiction, Corridor, JumpCheck
from controller.supervision.probe import Probe

TICK_S = 2e-3
MAGNET = Envelope(-1.0, 1.0, Limits(), 0.25, 10.0, 0.011, placed=True)
COIL = Envelope(-1.0, 1.0, Limits(), 1200.0, sense=-1.0)
SHAKEN = Envelope(0.0, 1.0, Limits(), shaken=True, without_gap_m=0.02)
AROUND_M = MAGNET.around_m


def reason(
    envelope: Envelope,
    drive: Callable[[float], float],
    place: Callable[[float], float],
    wanted: Callable[[float], float],
    seconds: float = 10.0,
    noise_m: float = 1e-4,
    resistance: Resistance = FREE,
) -> tuple[float, str]:
    """When and why a run in which drive and localisation say this is stopped; (inf, "") where it is not."""
    rng, watch = np.random.default_rng(0), Contradiction(envelope, noise_m, resistance)
    for k in range(round(seconds / TICK_S)):
        t = k * TICK_S
        said = watch.drove(drive(t), wanted(t), TICK_S)
        if k % 5 == 0:
            said = said or watch.saw(place(t) + noise_m * rng.standard_normal(), drive(t), wanted(t), t)
        if said:
            return t, said
    return math.inf, ""


def rest(t: float) -> float:
    """Nothing moves."""
    return 0.0


def test_an_envelope_is_its_gap_unless_stated() -> None:
    assert pytest.approx(0.011 / 0.95) == AROUND_M
    assert (COIL.around_m, SHAKEN.around_m) == (0.01, 0.02)
    assert Envelope(-1, 1, Limits(envelope_m=0.004), 1, 1).around_m == 0.004


@pytest.mark.parametrize("speed_m_s", [5e-4, 1e-3, 5e-3, 0.02])
def test_a_carriage_that_is_led_after_a_drift_is_stopped_within_the_gap(speed_m_s: float) -> None:
    """The localisation drifts, the loop holds its reading: the carriage goes away and takes the capsule along."""
    at, said = reason(MAGNET, lambda t: -speed_m_s * t, rest, rest, seconds=60.0)
    assert said.startswith(f"{CONTRADICT}: the ca")
    assert 0.85 * AROUND_M < speed_m_s * at < AROUND_M + 1.5e-4


def test_a_capsule_told_where_it_is_not_wanted_is_stopped() -> None:
    at, said = reason(COIL, rest, lambda t: 5e-3 * t, rest)
    assert "the localisation shows the capsule +10" in said
    assert at == pytest.approx(2.0, abs=0.3)


def test_a_capsule_that_goes_against_the_pull_is_stopped() -> None:
    """A localisation whose sign is turned: the capsule is told to go away from the carriage that pulls it."""
    at, said = reason(MAGNET, lambda t: 3e-3 + 3e-3 * t, lambda t: -3e-3 * t, lambda t: 0.0)
    assert "against the pull" in said
    assert 3e-3 * at < 6e-3
    assert "against the pull" in reason(COIL, lambda t: 0.5, lambda t: 5e-3 * t, lambda t: 5e-3 * t)[1], "sense -1"


def test_a_capsule_that_does_not_answer_is_stopped() -> None:
    at, said = reason(MAGNET, lambda t: min(5e-3 * t, 0.0105), rest, lambda t: 5e-3 * t)
    assert "does not answer" in said
    assert at == pytest.approx(0.9 * 0.011 / 5e-3 + 1.0, abs=0.1)
    at, said = reason(COIL, lambda t: -0.5, rest, rest, resistance=Resistance((0.12, 0.12)))
    assert "does not answer" in said
    assert at < 0.06
    assert reason(COIL, lambda t: -0.3, rest, rest, resistance=Resistance((0.12, 0.12))) == (math.inf, ""), (
        "a push that the coil holds"
    )
    _, said = reason(SHAKEN, lambda t: float(t % 0.1 < 0.03), rest, rest, seconds=20.0)
    assert "has not moved while the inner mass swung" in said


@pytest.mark.parametrize("speed_m_s", [1e-3, 2e-3, -5e-3])
def test_an_inner_mass_that_moves_its_capsule_slowly_is_left_alone(speed_m_s: float) -> None:
    """Half of the time on, seen with a noise of 0.5 mm: 2 mm/s are 4 mm within 2 s."""

    def place(t: float) -> float:
        return speed_m_s * t + 3e-4 * math.sin(40 * math.pi * t)

    found = reason(SHAKEN, lambda t: float(t % 0.05 < 0.025), place, place, 20.0, noise_m=5e-4)
    assert found == (math.inf, "")


def test_a_capsule_on_the_run_is_stopped_before_its_limit() -> None:
    at, said = reason(COIL, lambda t: -0.5, lambda t: 0.5 * t * t, lambda t: 0.5 * t * t)
    assert "mm/s, too near to its limit" in said
    assert at < 0.25, "0.25 of 0.3 m/s"


@pytest.mark.parametrize("frequency_Hz", [0.05, 0.2])
@pytest.mark.parametrize("lag_m", [3e-3, 6e-3])
def test_a_capsule_that_is_dragged_is_left_alone(frequency_Hz: float, lag_m: float) -> None:
    """A carriage ahead by what friction takes, a wave that pushes the capsule back by 2 mm, stick and slip."""

    def wanted(t: float) -> float:
        return 0.02 * math.sin(2 * math.pi * frequency_Hz * t)

    def way(t: float) -> float:
        return math.cos(2 * math.pi * frequency_Hz * t)

    def place(t: float) -> float:
        return wanted(t) - 1e-3 * (t % 0.3) + 2e-3 * math.sin(2 * math.pi * 0.3 * t)

    found = reason(MAGNET, lambda t: wanted(t) + lag_m * way(t), place, wanted, 40.0, noise_m=3e-4)
    assert found == (math.inf, "")


def test_readings_that_stray_alone_do_not_stop() -> None:
    rng = np.random.default_rng(1)
    assert reason(MAGNET, rest, lambda t: 0.03 * float(rng.random() < 0.03), rest, 20.0) == (math.inf, "")


def test_a_reference_that_jumps_gives_room_until_it_is_reached() -> None:
    corridor = Corridor(0.01, 0.25, 2e-3)
    assert not corridor.leaves(0.0, 0.0, TICK_S)
    assert not corridor.leaves(0.0, 0.05, TICK_S)
    for place in np.arange(0.0, 0.05, 1e-3):
        assert not corridor.leaves(float(place), 0.05, TICK_S)
    assert corridor.leaves(0.035, 0.05, TICK_S), "it has been there"
    corridor = Corridor(0.01, 0.25, 2e-3)
    assert not corridor.leaves(0.3, 0.0, TICK_S), "where it begins does not count"
    assert corridor.leaves(0.31, 0.0, TICK_S), "but it must come nearer"


def test_a_jump_is_doubted_until_three_readings_say_so() -> None:
    doubt = JumpCheck(1e-4)
    assert [doubt.takes(0.0, 0.01 * k) for k in range(3)] == [True] * 3
    assert [doubt.takes(0.01, 0.03 + 0.01 * k) for k in range(4)] == [False, False, True, True]
    assert not doubt.takes(-0.01, 0.07)
    assert doubt.takes(0.01, 0.08)


def probed(
    envelope: Envelope, place: Callable[[float], float], drive: Callable[[float, float], float], noise_m: float = 3e-4
) -> str:
    """What a probe says of a capsule at `place(w)` where `w` is wanted, behind a drive at `drive(place, way)`."""
    probe, rng = Probe(envelope), np.random.default_rng(2)
    for t in np.arange(0.0, probe.path.end_s, 0.01):
        at = np.array([t])
        w, v = float(probe.path.position(at)[0]), float(probe.path.speed(at)[0])
        y = place(w)
        probe.saw(y + noise_m * rng.standard_normal(), drive(y, float(np.sign(v))), w, v)
    return probe.reason()


def test_a_probe_passes_a_sound_rig_over_folds_and_finds_what_is_told_wrongly() -> None:
    def dragging(share: float) -> Callable[[float, float], float]:
        def drive(y: float, way: float) -> float:
            return share * (y + way * (3e-3 + 0.9e-3 * math.sin(2 * math.pi * y / 7.3e-3)))

        return drive

    assert probed(MAGNET, lambda w: w, dragging(1.0)) == ""
    assert probed(COIL, lambda w: 0.8 * w, lambda y, way: 0.2 * way) == ""
    for share in (0.5, 2.0):
        assert "times the travel of the capsule that it drags" in probed(MAGNET, lambda w: w, dragging(share))
    for envelope in (MAGNET, COIL, SHAKEN):
        assert "does not answer" in probed(envelope, lambda w: 0.1 * w, dragging(1.0))
        assert "moves against the drive" in probed(envelope, lambda w: -w, dragging(1.0))
    assert "readings" in Probe(MAGNET).reason()
