"""Residuals of a time series at many points, against plain NumPy from the model's output at even times."""

from collections.abc import Iterator

import numpy as np
import pytest

from models.checks.usable import counted, gone, used
from models.identification.kind import Array
from models.identification.kinds.series.drive_input import evenly, feed, interval
from models.identification.kinds.series.series import SeriesKind
from models.identification.kinds.series.simulation import Runner, _model
from models.identification.settings import SET
from models.records.record import USED, Record
from models.rigs.reader import parse_rig
from models.theta import Theta
from tests.bench.bench_drives import believed

KINDS = ("pull", "magnetic", "coil", "vibro")
DELAYS = (0.0, 0.013, 0.0047)


def record_of(name: str, even: bool, seed: int = 5) -> Record:
    """A motion of 3 s with random measured values, some of which do not count."""
    rng = np.random.default_rng(seed)
    t = 2e-3 * np.arange(1500)
    t = t if even else t + 6e-4 * rng.uniform(-1, 1, len(t))
    swing = np.sin(3 * t)
    driven = {
        "pull": {"position_m": 2e-3 * (t + swing)},
        "magnetic": {"carriage_position_m": 5e-3 * (t + swing)},
        "coil": {"coil_current_A": swing},
        "vibro": {"drive_on": (np.arange(len(t)) % 25 < 10).astype(float)},
    }[name]
    measured = "force_N" if name == "pull" else "position_m"
    used = rng.random(len(t)) > 0.3
    used[600:900] = False
    return Record("r", name, {"t_s": t, **driven, measured: 1e-2 * rng.standard_normal(len(t)), USED: 1.0 * used})


def kind_of(name: str, record: Record) -> SeriesKind:
    raw = {key: value for key, value in believed("coil" if name != "vibro" else "vibro_gut").items() if key != "noise"}
    magnet = {"magnet_stiffness_N_per_m": 25.0, "magnet_range_m": 0.02} if name == "magnetic" else {}
    head = raw["rig"] if name in ("coil", "vibro") else {"kind": name, **magnet}
    return SeriesKind.from_rig(parse_rig({**raw, "rig": head}), [record])


def points(kind: SeriesKind) -> Iterator[Theta]:
    """Eleven points with and without effects and delays, in no order."""
    rng = np.random.default_rng(0)
    for k in range(11):
        moved = {p.key: p.value * (1 + 0.05 * rng.standard_normal()) for p in kind.base if p.fit}
        delay = DELAYS[k % 3]
        yield kind.nominal() | moved | ({("sensor_delay", "delay_s"): delay} if delay else {})


def plain(kind: SeriesKind, record: Record, theta: Theta, criterion: int) -> Array:
    """The residuals of a free run."""
    columns = (kind.drive.commanded, kind.drive.measured, USED)
    even, t, y = evenly(record, columns), record["t_s"], record[kind.quantity]
    shown = kind._runs(even, [theta.without("sensor_delay")], None, fine=criterion == kind.final)[0]
    late = theta.get(("sensor_delay", "delay_s"), 0.0)
    output = np.interp(t - late, even["t_s"], shown) if late or even is not record else shown
    if not kind.drive.anchored:
        n = round(SET.start_s / interval(record))
        output = output + np.mean((y[:n] - output[:n])[used(record)[:n]])
    return weight(kind, record, output)


def observed(kind: SeriesKind, record: Record, theta: Theta) -> Array:
    """The residuals under the observer, of a body whose position the drive settles."""
    runner = Runner(kind.surface, kind.drive, kind.catalogue)
    active = tuple(kind.catalogue[name] for name in theta.effects)
    assembly, kernel = _model(kind.surface, kind.drive, active)
    even = evenly(record, (kind.drive.commanded, kind.drive.measured, USED))
    fed, late = feed(kind.drive, even, kind.drive.imposed, 0.0, False), theta.get(("sensor_delay", "delay_s"), 0.0)
    seen, at = np.where(gone(even), np.nan, even[kind.quantity]), np.arange(len(even))
    shown, state = np.empty(len(even)), runner._start(assembly, even, True)
    seen = np.interp(at + late / fed.dt, at, seen)
    kernel.one(state, fed.commands, seen, fed.dt / kind.memory, assembly.vector(theta), fed.substeps, fed.dt, shown)
    return weight(kind, record, np.interp(record["t_s"] - late, even["t_s"], shown))


def weight(kind: SeriesKind, record: Record, output: Array) -> Array:
    """The residuals of an output (n,): those that count, neighbours averaged, with less weight in the tail."""
    r = np.clip((record[kind.quantity] - output) / kind.noise_std, -SET.diverged, SET.diverged)[counted(record)]
    r = r[: len(r) // kind.averaged * kind.averaged].reshape(-1, kind.averaged).mean(axis=1) * np.sqrt(kind.averaged)
    return np.asarray(r * np.sqrt(2 / (1 + np.sqrt(1 + (r / SET.tail) ** 2))))


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("name", KINDS)
def test_many_points_at_once_are_plain_residuals(name: str, even: bool) -> None:
    record = record_of(name, even)
    kind = kind_of(name, record)
    thetas = list(points(kind))
    assert kind.averaged > 1
    for criterion in (0, kind.free_run, kind.final) if kind.drive.anchored else (kind.free_run, kind.final):
        got = kind.stacked(record, thetas, criterion)
        want = [plain(kind, record, t, criterion) if criterion else observed(kind, record, t) for t in thetas]
        assert got.flags.c_contiguous
        np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-12 * np.max(np.abs(want)))


@pytest.mark.parametrize("name", KINDS)
def test_what_is_kept_of_a_record_changes_nothing(name: str) -> None:
    """The same numbers at the first and the second evaluation, of a copy of the record, and of each point alone."""
    record = record_of(name, False)
    kind = kind_of(name, record)
    thetas = list(points(kind))
    other = record_of(name, False, seed=6)
    for criterion in (0, kind.free_run, kind.final):
        first = kind.stacked(record, thetas, criterion)
        assert not np.allclose(kind.stacked(other, thetas, criterion)[:, :50], first[:, :50])
        np.testing.assert_array_equal(kind.stacked(record, thetas, criterion), first)
        np.testing.assert_array_equal(kind.stacked(record.rows(slice(None)), thetas, criterion), first)
        np.testing.assert_array_equal([kind.residual(record, theta, criterion) for theta in thetas], first)


def test_what_is_slow_of_residuals_are_their_means_over_time_as_if_none_counted_less() -> None:
    """White noise keeps its variance; a step of many standard deviations shows in full."""
    record = record_of("pull", True)
    kind, rng = kind_of("pull", record), np.random.default_rng(2)
    far = 100.0 * (np.arange(60_000) > 30_000)
    r = far + rng.standard_normal(60_000)
    slow = kind.slow([record], np.array([r * np.sqrt(2 / (1 + np.sqrt(1 + (r / SET.tail) ** 2)))]))[0]
    count = round(SET.slow_s / (interval(record) * kind.averaged))
    assert len(slow) == 60_000 // count
    assert slow == pytest.approx(r[: len(slow) * count].reshape(-1, count).mean(axis=1) * np.sqrt(count))
    assert np.std(slow[: len(slow) // 2 - 1]) == pytest.approx(1.0, abs=0.1)
    assert kind.slow([record], np.ones((2, count - 1))).shape == (2, count - 1)
