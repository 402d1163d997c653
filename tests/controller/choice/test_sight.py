"""A controller does not lead with a localisation that is too slow or too late for it."""

from pathlib import Path

import pytest

from controller.choice.sight import unfit
from controller.drives import envelope_of
from controller.supervision.contradiction import Contradiction
from hil.app.main import run
from hil.app.scenario.chosen import mission_of
from hil.app.scenario.scenario import parse_track_scenario
from hil.app.track.loop import believed_model, run_loop
from hil.app.track.score import score
from models.theta import Theta
from tests.bench.bench_localisation import seen
from tests.controller.loops import model_of


def scenario(
    kind: str, rate_Hz: float, late_s: float, speed_mm_s: float = 2.0, age_s: float = 0.5
) -> dict[str, object]:
    return {
        "scenario": {"duration_s": 8.0},
        "rig": {"kind": kind},
        "tissue": {"preset": "jejunum"},
        "localisation": {"rate_Hz": rate_Hz, "latency_s": late_s, "std": 2e-4},
        "limits": {"age_s": age_s},
        "control": {"tick_s": 0.002},
        "reference": {"kind": "ramp", "speed_mm_s": speed_mm_s},
    }


def why_not(controller: str, *stated: object, **more: float) -> str:
    loop = parse_track_scenario(scenario(*stated, **more))  # type: ignore[arg-type]
    return unfit(mission_of(loop), believed_model(loop, Theta()), controller)


@pytest.mark.parametrize("late_s", [0.05, 0.1, 0.2])
def test_without_a_model_a_coil_is_not_led_by_late_readings(late_s: float) -> None:
    """Led so, the capsule swung and broke the speed limit; with a model it tracks to a tenth of a millimetre."""
    assert "pid" in why_not("pid", "coil", 100.0, late_s)
    assert not why_not("feedforward", "coil", 100.0, late_s)


def test_what_is_refused_fails_in_the_plant_and_what_is_not_tracks() -> None:
    loop = parse_track_scenario(scenario("coil", 10.0, 0.008))
    model = believed_model(loop, Theta())
    for controller in ("pid", "feedforward"):
        trace = run_loop(loop, model, controller, 1)
        worth = score(loop, trace)
        good = worth.hard_violations == 0 and not trace.halted and worth.tracking_rmse_m < 1e-3
        assert good == (not unfit(mission_of(loop), model, controller))


def test_a_controller_with_a_model_is_tried_too() -> None:
    """At 1 Hz the LQR lets the magnet pull in vain, feedforward does not."""
    loop = seen("magnetic", 1.0, 0.008)
    model = believed_model(loop, Theta())
    assert "faster or less late for lqr" in unfit(mission_of(loop), model, "lqr")
    assert not unfit(mission_of(loop), model, "feedforward")


def test_an_inner_mass_follows_late_readings_five_times_a_second() -> None:
    """40 mm at 10 mm/s forth and back: no rule takes it for a capsule that does not move."""
    loop = seen("vibro", 5.0, 0.2)
    trace = run_loop(loop, believed_model(loop, Theta()), "vibro", 0)
    assert not trace.halted
    assert score(loop, trace).tracking_rmse_m < 6e-3


def test_a_controller_that_is_often_taken_from_the_lead_is_refused() -> None:
    """At 5 Hz, 200 ms late, the drive of a PID with friction stands at its limit and stops, a quarter of the time."""
    loop = seen("magnetic", 5.0, 0.2)
    model = believed_model(loop, Theta())
    assert "pid_friction must lead 90 % of the ticks" in unfit(mission_of(loop), model, "pid_friction")
    assert not unfit(mission_of(loop), model, "pid_friction_estimated")


def test_a_good_localisation_is_not_blamed_for_what_fails_without_it() -> None:
    """On a model whose readings are late by themselves the PID swings, with 200 Hz as with 100 Hz."""
    loop = parse_track_scenario(scenario("magnetic", 200.0, 0.015))
    late = Theta(effects={"sensor_delay": {"delay_s": 0.1}})
    assert not unfit(mission_of(loop), believed_model(loop, late), "pid")


def test_a_reading_that_ages_beyond_the_limit_and_a_reference_too_fast_are_told() -> None:
    assert "limits.age_s = 0.15" in why_not("feedforward", "magnetic", 5.0, 0.008, age_s=0.15)
    assert not why_not("feedforward", "magnetic", 5.0, 0.008)
    assert "slower than 16.4 mm/s" in why_not("feedforward", "coil", 5.0, 0.008, speed_mm_s=20.0)


def test_a_reference_that_goes_on_between_few_readings_ends_a_run() -> None:
    """On a bus nobody states the rate: three readings must come while the reference stays within the envelope."""
    envelope = envelope_of(model_of("coil").drive)
    watch, far_m, dt = Contradiction(envelope, 2e-4), 0.0, 1e-3
    slow, quick = 0.2 * envelope.around_m, 2 * envelope.around_m
    for speed, ends in ((slow, False), (quick, True)):
        reasons = set[str]()
        watch.begin()
        for k in range(3000):
            far_m = speed * k * dt
            reasons.add(watch.drove(0.0, far_m, dt))
            if k % 200 == 0:
                reasons.add(watch.saw(far_m, 0.0, far_m, k * dt))
        assert any("too slow or late" in reason for reason in reasons) == ends


@pytest.mark.parametrize("command", ["track", "sil"])
def test_commands_refuse_with_one_sentence(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "slow.toml"
    text = '[scenario]\nduration_s = 2.0\n[rig]\nkind = "magnetic"\n[tissue]\npreset = "jejunum"\n'
    text += '[localisation]\nrate_Hz = 2.0\n[reference]\nkind = "ramp"\nspeed_mm_s = 1.0\n'
    file.write_text(text, encoding="utf-8")
    assert run([command, str(file)]) == 2
    assert "limits.age_s" in capsys.readouterr().err
