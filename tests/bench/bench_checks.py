"""False alarms and power of every check of `capsule check`.

`python -m tests.bench.bench_checks [--series 12] [--seconds 20] [--fault NAME...]` makes so many series of the plant
without a hidden effect and with one (kinds in turn, noise from 0.3 to 5 times the usual), looks at each record as it
is, and then with one fault (all, or those named) at each of its sizes. Prints, as Markdown, the share of clean records
in which a check says something, and of the spoiled ones those in which the check for that fault does, those in which
only another one says something new that stops or weakens (wrongly named), and those in which none does. Axes, which the
plant does not have, are made here, with a friction of another form than the catalogue's. Where the shared
measured records are found (CAPSULE_SHARED), what the checks say of those follows, record by record.
"""

import argparse
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from models.checks.examine import examine
from models.checks.view import Array, View
from models.records.clock import one_clock
from models.records.record import Record, read_record, record_of
from models.rigs.reader import parse_rig, read_rig
from models.rigs.rig import Rig
from plant.hidden.registry import HIDDEN, hidden
from tests.places import SHARED
from tests.plant.series import make_series

KINDS: Final[tuple[str, ...]] = ("pull", "magnetic", "coil", "vibro_plate", "vibro")
AXIS: Final = "axis"
SHAKEN: Final = ("vibro", "vibro_plate")
NOISES: Final = (0.3, 1.0, 5.0)

Spoil = Callable[[View, float, np.random.Generator], Record]


@dataclass(frozen=True)
class Fault:
    """How a record is spoiled, the checks that may say so, sizes from weak to strong with their unit, and kinds of rig
    (all where empty).
    """

    spoil: Spoil
    check: str
    sizes: tuple[float, ...]
    unit: str
    kinds: tuple[str, ...] = ()


def _measured(view: View, values: Array) -> Record:
    return view.record.with_column(view.measured, values)


def _rows(view: View, rows: NDArray[np.int64]) -> Record:
    columns = {name: values[rows] for name, values in view.record.columns.items()}
    return Record(view.record.name, view.record.kind, columns)


def turned(view: View, size: float, rng: np.random.Generator) -> Record:
    """Sign of the measured column turned round."""
    return _measured(view, -view.y)


def driven_scaled(view: View, size: float, rng: np.random.Generator) -> Record:
    """The driven column in another unit, `size` times larger."""
    return view.record.with_column(str(view.driven), size * view.record[str(view.driven)])


def clipped(view: View, size: float, rng: np.random.Generator) -> Record:
    """A share `size` of the samples beyond the range of the amplifier."""
    return _measured(view, np.clip(view.y, *np.quantile(view.y, [size / 2, 1 - size / 2])))


def held(view: View, size: float, rng: np.random.Generator) -> Record:
    """Each value written `size` times."""
    n = int(size)
    return _measured(view, np.repeat(view.y[::n], n)[: len(view.y)])


def coarse(view: View, size: float, rng: np.random.Generator) -> Record:
    """A resolution of `size` standard deviations of the noise."""
    step = size * view.noise
    return _measured(view, step * np.round(view.y / step))


def spiked(view: View, size: float, rng: np.random.Generator) -> Record:
    """Five single samples off by `size` times the span."""
    values = view.y.copy()
    at = rng.choice(np.arange(20, len(values) - 20), 5, replace=False)
    values[at] += size * np.ptp(values) * rng.choice([-1, 1], 5)
    return _measured(view, values)


def humming(view: View, size: float, rng: np.random.Generator) -> Record:
    """Mains of `size` standard deviations of the noise."""
    return _measured(view, view.y + size * view.noise * np.sin(2 * np.pi * 50 * view.t))


def noisy(view: View, size: float, rng: np.random.Generator) -> Record:
    """Noise `size` times the stated one."""
    extra = np.sqrt(size**2 - 1) * view.noise
    return _measured(view, view.y + extra * rng.standard_normal(len(view.y)))


def coloured(view: View, size: float, rng: np.random.Generator) -> Record:
    """More noise, as much as there is, of which each sample keeps a share `size` of the one before."""
    extra = lfilter([np.sqrt(1 - size**2)], [1, -size], rng.standard_normal(len(view.y)))
    return _measured(view, view.y + view.noise * extra)


def restarted(view: View, size: float, rng: np.random.Generator) -> Record:
    """Stamps that begin again at a share `size` of the record."""
    t, k = view.t.copy(), int(size * len(view.t))
    t[k:] -= t[k]
    return view.record.with_column("t_s", t)


def uneven(view: View, size: float, rng: np.random.Generator) -> Record:
    """Stamps off by up to `size` of the interval."""
    return view.record.with_column("t_s", view.t + size * view.dt * rng.uniform(-1, 1, len(view.t)))


def lost(view: View, size: float, rng: np.random.Generator) -> Record:
    """A share `size` of the samples missing."""
    return _rows(view, np.flatnonzero(rng.random(len(view.t)) >= size))


def paused(view: View, size: float, rng: np.random.Generator) -> Record:
    """A gap of `size` s in the middle."""
    return _rows(view, np.flatnonzero(np.abs(view.t - np.mean(view.t)) > size / 2))


def late(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column late by `size` s."""
    return _measured(view, np.interp(view.t - size, view.t, view.y))


def drifting(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column late by `size` s more at the last stamp than at the first."""
    share = (view.t - view.t[0]) / (view.t[-1] - view.t[0])
    return _measured(view, np.interp(view.t - size * share, view.t, view.y))


def scaled(view: View, size: float, rng: np.random.Generator) -> Record:
    """The moving column in another unit, `size` times larger."""
    return view.record.with_column(view.moving_column, size * view.record[view.moving_column])


def other_unit(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column in another unit, `size` times larger."""
    return _measured(view, size * view.y)


def silent(view: View, size: float, rng: np.random.Generator) -> Record:
    """A constant and noise of `size` times what it was."""
    return _measured(view, np.mean(view.y) + size * view.noise * rng.standard_normal(len(view.y)))


def cut_off(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column held for `size` s in the middle."""
    middle = np.abs(view.t - np.mean(view.t)) <= size / 2
    return _measured(view, np.where(middle, view.y[np.flatnonzero(middle)[0]], view.y))


def unanswered(view: View, size: float, rng: np.random.Generator) -> Record:
    """`size` samples of -999 in the middle."""
    values = view.y.copy()
    values[len(values) // 2 :][: int(size)] = -999.0
    return _measured(view, values)


def jumping(view: View, size: float, rng: np.random.Generator) -> Record:
    """A measured place that jumps by `size` m in the middle."""
    return _measured(view, view.y + np.where(view.t > np.mean(view.t), size, 0.0))


def offset(view: View, size: float, rng: np.random.Generator) -> Record:
    """A measured column off by `size` times its span."""
    return _measured(view, view.y + size * np.ptp(view.y))


def exchanged(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column for the driven one, and the other way round."""
    return _measured(view, view.record[str(view.driven)]).with_column(str(view.driven), view.y)


def stepped(view: View, size: float, rng: np.random.Generator) -> Record:
    """An encoder of the driven place with a step of `size` m."""
    return view.record.with_column(str(view.driven), size * np.round(view.record[str(view.driven)] / size))


def stuck(view: View, size: float, rng: np.random.Generator) -> Record:
    """A driven place that stands still over the last share `size` of the record."""
    k = int((1 - size) * len(view.t))
    place = view.record[str(view.driven)].copy()
    place[k:] = place[k]
    return view.record.with_column(str(view.driven), place)


def begun_before(view: View, size: float, rng: np.random.Generator) -> Record:
    """A record that begins in the first motion that is faster than `size` of the usual for 0.2 s."""
    usual = float(np.median(np.abs(view.speed[view.moves])))
    window = max(2, round(0.2 / view.dt))
    fast = np.convolve(np.abs(view.speed) > size * usual, np.ones(window), "valid") >= window
    return _rows(view, np.arange(int(np.argmax(fast)), len(view.t)))


def repeated(view: View, size: float, rng: np.random.Generator) -> Record:
    """A share `size` of the stamps the same as the one before."""
    t = view.t.copy()
    again = np.flatnonzero(rng.random(len(t) - 1) < size) + 1
    t[again] = t[again - 1]
    return view.record.with_column("t_s", t)


def other_seconds(view: View, size: float, rng: np.random.Generator) -> Record:
    """Stamps in another unit, `size` times larger."""
    return view.record.with_column("t_s", size * view.t)


def unsigned(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column without its sign."""
    return _measured(view, np.abs(view.y))


def again(view: View, size: float, rng: np.random.Generator) -> Record:
    """The driven column once more, `size` times as large, for the measured one."""
    return _measured(view, size * view.record[str(view.driven)])


def enabled(view: View, size: float, rng: np.random.Generator) -> Record:
    """The driven column on throughout."""
    return view.record.with_column(str(view.driven), np.ones(len(view.t)))


def dead(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column `size` throughout."""
    return _measured(view, np.full_like(view.y, size))


def backwards(view: View, size: float, rng: np.random.Generator) -> Record:
    """The rows in reverse order."""
    return _rows(view, np.arange(len(view.t))[::-1])


def wrapped(view: View, size: float, rng: np.random.Generator) -> Record:
    """A measured place that begins again after `size` of its span."""
    return _measured(view, np.mod(view.y - np.min(view.y), size * np.ptp(view.y)))


def ahead(view: View, size: float, rng: np.random.Generator) -> Record:
    """One stamp in the middle `size` s ahead, read as a file is."""
    t = view.t.copy()
    t[len(t) // 2] += size
    return _read(view, {"t_s": t})


def doubled(view: View, size: float, rng: np.random.Generator) -> Record:
    """So many stamps twice, read as a file is."""
    t = view.t.copy()
    at = rng.choice(np.arange(1, len(t)), int(size), replace=False)
    t[at] = t[at - 1]
    return _read(view, {"t_s": t})


def as_steps(view: View, size: float, rng: np.random.Generator) -> Record:
    """Stamps that are the times since the stamp before, read as a file is."""
    return _read(view, {"t_s": np.diff(view.t, prepend=view.t[0])})


def own_clocks(view: View, size: float, rng: np.random.Generator, who: int) -> Record:
    """Both columns on clocks of their own, the driven (0) or the measured one (1) away for `size` s."""
    names = (str(view.driven), view.measured)
    stamps = [view.t, view.t + 0.3 * view.dt]
    kept = [np.ones(len(view.t), dtype=bool), np.ones(len(view.t), dtype=bool)]
    kept[who] = np.abs(view.t - np.mean(view.t)) > size / 2
    samples = {n: (t[k], view.record[n][k]) for n, t, k in zip(names, stamps, kept, strict=True)}
    columns, _, lost = one_clock(samples, view.measured)
    return record_of(view.record.name, columns, view.rig, lost=lost, lenient=True)


def drive_away(view: View, size: float, rng: np.random.Generator) -> Record:
    """The driven column's channel away for `size` s."""
    return own_clocks(view, size, rng, 0)


def sensor_away(view: View, size: float, rng: np.random.Generator) -> Record:
    """The measured column's channel away for `size` s."""
    return own_clocks(view, size, rng, 1)


def _read(view: View, changed: dict[str, Array]) -> Record:
    columns = {name: view.record[name] for name in ("t_s", str(view.driven), view.measured)}
    return record_of(view.record.name, columns | changed, view.rig, lenient=True)


def slipped(view: View, size: float, rng: np.random.Generator) -> Record:
    """A place that slips by `size` of its span, twice."""
    t, place = view.t, view.record[view.moving_column]
    steps = sum(np.where(t > share * t[-1], size * np.ptp(place), 0.0) for share in (0.31, 0.74))
    return view.record.with_column(view.moving_column, place + steps)


def speed_late(view: View, size: float, rng: np.random.Generator) -> Record:
    """A logged speed behind a low-pass of `size` s."""
    kept = float(np.exp(-view.dt / size))
    return view.record.with_column(SPEED, lfilter([1 - kept], [1, -kept], view.record[SPEED]))


def speed_scaled(view: View, size: float, rng: np.random.Generator) -> Record:
    """A logged speed `size` times as large."""
    return view.record.with_column(SPEED, size * view.record[SPEED])


def second_place(view: View, size: float, rng: np.random.Generator) -> Record:
    """A second encoder, late by `size` s."""
    return view.record.with_column("encoder_2_mm", 1e3 * np.interp(view.t - size, view.t, view.record["position_m"]))


def second_force(view: View, size: float, rng: np.random.Generator) -> Record:
    """A second load cell, which shows `size` times the force, with as much noise."""
    return view.record.with_column("cell_2_N", size * (view.y + view.noise * rng.standard_normal(len(view.y))))


def accelerometer(view: View, size: float, rng: np.random.Generator) -> Record:
    """An accelerometer that shows `size` times the acceleration, with noise of a tenth of it."""
    acceleration = np.gradient(view.record[SPEED], view.t)
    smooth = np.convolve(acceleration, np.full(40, 1 / 40), "same")
    return view.record.with_column(
        "acc_m_s2", size * (smooth + 0.1 * np.std(smooth) * rng.standard_normal(len(smooth)))
    )


SPEED: Final = "velocity_m_s"
FAULTS: Final = {
    "stamp far ahead": Fault(ahead, "stamps_astray", (0.1, 1.0, 12.0), "s"),
    "doubled stamps": Fault(doubled, "stamps_repeated", (1.0, 3.0, 10.0), "stamps"),
    "stamps are differences": Fault(as_steps, "differences", (1.0,), ""),
    "channel of the drive away": Fault(drive_away, "gap pause", (0.3, 1.0, 5.0), "s", ("pull", "magnetic", "coil")),
    "channel of the sensor away": Fault(sensor_away, "pause", (0.3, 1.0, 5.0), "s", ("pull", "magnetic", "coil")),
    "encoder slips": Fault(slipped, "place_jumps", (0.01, 0.03, 0.1), "of the span", (AXIS,)),
    "logged speed filtered": Fault(speed_late, "speed_apart", (0.005, 0.01, 0.03), "s", (AXIS,)),
    "logged speed in another unit": Fault(speed_scaled, "speed_apart", (0.9, 0.1, 1000.0), "times", (AXIS,)),
    "logged speed turned round": Fault(speed_scaled, "speed_apart", (-1.0,), "times", (AXIS,)),
    "second place late": Fault(second_place, "column_repeated", (0.005, 0.01, 0.03), "s", (AXIS,)),
    "second force in another unit": Fault(second_force, "column_repeated", (0.9, 0.1, 1000.0), "times", (AXIS,)),
    "acceleration in another unit": Fault(accelerometer, "column_repeated", (-1.0, 0.1, 1000.0), "times", (AXIS,)),
    "sign turned round": Fault(turned, "force_sign drive_sign", (1.0,), "", ("pull", "magnetic", *SHAKEN)),
    "sign of the drive turned round": Fault(driven_scaled, "force_sign", (-1.0,), "times", ("coil",)),
    "other unit of the drive": Fault(driven_scaled, "force_size", (1000.0, 10.0, 0.1), "times", ("coil",)),
    "sign not logged": Fault(unsigned, "force_unsigned", (1.0,), "", ("pull",)),
    "driven column twice": Fault(again, "columns_same", (0.1, 1.0, 1000.0), "times", ("pull", "magnetic", "coil")),
    "sensor dead": Fault(dead, "no_response", (0.0, 0.04), ""),
    "place wraps": Fault(wrapped, "place_wraps", (0.5, 0.8), "of the span", ("magnetic", "coil")),
    "rows in reverse": Fault(backwards, "stamps_reversed", (1.0,), ""),
    "clipping": Fault(clipped, "clipping", (0.005, 0.02, 0.1), "of the samples"),
    "held values": Fault(held, "held_values", (3.0, 5.0, 10.0), "times"),
    "coarse resolution": Fault(coarse, "resolution", (3.0, 10.0, 30.0), "std of noise"),
    "outliers": Fault(spiked, "outliers", (0.1, 0.3, 1.0), "of the span"),
    "mains": Fault(humming, "tone", (0.3, 1.0, 3.0), "std of noise", ("pull", "magnetic", "coil")),
    "more noise than stated": Fault(noisy, "noise_stated", (1.5, 2.0, 4.0), "times"),
    "coloured noise": Fault(coloured, "noise_coloured", (0.5, 0.8, 0.95), "of the sample before", ("pull", "magnetic")),
    "stamps begin again": Fault(restarted, "stamps_restart", (0.5,), "of the record"),
    "uneven stamps": Fault(uneven, "stamps_uneven", (0.03, 0.1, 0.3), "of the interval"),
    "repeated stamps": Fault(repeated, "stamps_repeated", (0.001, 0.01, 0.1), "of the stamps"),
    "stamps in another unit": Fault(other_seconds, "time_units", (1e3, 1e6, 1e-3), "times"),
    "begun before the record": Fault(
        begun_before, "starts_in_motion", (0.5,), "of the usual speed", ("pull", "magnetic")
    ),
    "missing samples": Fault(lost, "stamps_missing", (0.001, 0.01, 0.05), "of the samples"),
    "pause": Fault(paused, "pause", (0.1, 0.5, 2.0), "s"),
    "late force": Fault(late, "clock_offset", (0.01, 0.02, 0.04), "s", ("pull",)),
    "late place": Fault(late, "clock_offset", (0.02, 0.03, 0.04), "s", SHAKEN),
    "drifting clock": Fault(drifting, "clock_drift", (0.04, 0.1, 0.2), "s in all", ("pull", "magnetic", *SHAKEN)),
    "other unit": Fault(scaled, "units", (1000.0, 1e-3), "times", ("pull", "magnetic", "coil")),
    "other unit of the capsule's place": Fault(other_unit, "units", (10.0, 0.1), "times", ("magnetic", *SHAKEN)),
    "other unit of the force": Fault(other_unit, "force_size units", (10.0, 0.1, 102.0, 1000.0), "times", ("pull",)),
    "sensor lost": Fault(cut_off, "sensor_silent", (0.2, 1.0, 4.0), "s"),
    "no value": Fault(unanswered, "no_values", (1.0, 10.0, 100.0), "samples"),
    "place jumps": Fault(jumping, "place_jumps", (1e-3, 5e-3, 20e-3), "m", ("magnetic", "coil", "vibro_plate")),
    "zero elsewhere": Fault(offset, "zeros_apart", (0.5, 1.0, 2.0), "of the span", ("pull", "magnetic")),
    "columns exchanged": Fault(exchanged, "columns_exchanged units", (1.0,), "", ("pull", "magnetic")),
    "coarse encoder": Fault(stepped, "driven_resolution", (2e-5, 1e-4, 5e-4), "m", ("pull", "magnetic")),
    "drive logged as a switch": Fault(enabled, "drive_constant", (1.0,), "", SHAKEN),
    "encoder stuck": Fault(stuck, "driven_stuck", (0.2, 0.4, 0.6), "of the record", ("pull",)),
    "no response": Fault(silent, "no_response", (1.0, 5.0), "times the noise", ("pull", "magnetic")),
}


def records(count: int, seconds: float, folder: Path) -> Iterator[tuple[str, View]]:
    """So many series in turn of each kind, noise and hidden effect (every other one has none)."""
    for k in range(count):
        kind, noise = KINDS[k % len(KINDS)], NOISES[k // len(KINDS) % len(NOISES)]
        able = [e.id for e in HIDDEN if kind.removesuffix("_plate") in hidden(e.id).drives]
        effect = able[k % len(able)] if k % 2 else None
        out = make_series(kind, effect, 9000 + k, folder / f"{k}", seconds, noise, 100.0 if noise > 1 else 500.0)
        rig = read_rig(out / "rig.toml")
        for path in sorted(out.glob("*.csv.gz")):
            yield kind, View(read_record(path, rig), rig)


def axes(count: int, seconds: float) -> Iterator[tuple[str, View]]:
    """So many records of a stage with a logged speed; the friction rises with the square root of the speed."""
    rig = parse_rig({"rig": {"kind": AXIS}})
    for k in range(count):
        rng = np.random.default_rng(7000 + k)
        t = np.arange(0.0, seconds, 1e-3)
        waves = [
            (a, f, p) for a, f, p in zip((0.05, 0.02), rng.uniform(0.2, 1.2, 2), rng.uniform(0, 6, 2), strict=True)
        ]
        x = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in waves)
        v = sum(2 * np.pi * f * a * np.cos(2 * np.pi * f * t + p) for a, f, p in waves)
        force = rng.uniform(1, 5) * np.gradient(v, t) + 3 * np.sign(v) * (1 + np.sqrt(np.abs(v)))
        noises = (1e-6, 1e-3, 0.05 * float(np.std(force)))
        values = [one + std * rng.standard_normal(len(t)) for one, std in zip((x, v, force), noises, strict=True)]
        columns = dict(zip(("position_m", SPEED, "force_N"), values, strict=True))
        yield AXIS, View(record_of(f"axis {k}", {"t_s": t, **columns}, rig), rig)


def said_of(record: Record, rig: Rig) -> set[str]:
    """Ids of the findings."""
    return {finding.id for finding in examine(rig, [record])}


def tables(count: int, seconds: float, faults: dict[str, Fault] = FAULTS) -> str:
    """Both tables as Markdown, the second one with these `faults`."""
    clean: Counter[str] = Counter()
    hit: dict[tuple[str, float], list[str]] = defaultdict(list)
    seen = 0
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        for kind, view in chain(axes(5, seconds), records(count, seconds, Path(folder))):
            before = said_of(view.record, view.rig)
            clean.update(before)
            seen += 1
            for name, fault in faults.items():
                if kind not in (fault.kinds or KINDS):
                    continue
                if before & set(fault.check.split()):  # told already: nothing to learn
                    continue
                for size in fault.sizes:
                    found = examine(view.rig, [fault.spoil(view, size, rng)])
                    right = {one.id for one in found} & set(fault.check.split())
                    other = {one.id for one in found if one.severity != "note"} - before
                    hit[name, size].append("found" if right else "wrong" if other else "silent")
    checks = sorted({c for fault in FAULTS.values() for c in fault.check.split()} | set(clean))
    lines = [f"{seen} records as the plant makes them:", "", "| check | says something in |", "| --- | --- |"]
    lines += [f"| `{check}` | {clean[check]} of {seen} |" for check in checks]
    lines += ["", "The same with one fault each:", "", "| fault | size | found | wrongly named | silent |"]
    lines.append("| --- | --- | --- | --- | --- |")
    for (name, size), told in hit.items():
        counts = " | ".join(f"{told.count(how)} of {len(told)}" for how in ("found", "wrong", "silent"))
        lines.append(f"| {name} | {size:g} {FAULTS[name].unit} | {counts} |")
    every = [how for told in hit.values() for how in told]
    lines.append(f"| all | | {every.count('found')} | {every.count('wrong')} | {every.count('silent')} |")
    return "\n".join(lines)


def measured() -> Iterator[str]:
    """What the checks say of the shared measured records."""
    rig = parse_rig({"rig": {"kind": "axis"}})
    for path in sorted((SHARED / "data" / "emps").glob("*.csv")):
        said = said_of(read_record(path, rig), rig)
        yield f"EMPS {path.stem}: {', '.join(sorted(said)) or 'nothing'}"


def main() -> None:
    """Read the options and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("--series", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--fault", nargs="*", choices=FAULTS, default=list(FAULTS), help="these faults alone")
    options = parser.parse_args()
    print(tables(options.series, options.seconds, {name: FAULTS[name] for name in options.fault}))
    print()
    for line in measured():
        print(line)


if __name__ == "__main__":
    main()
