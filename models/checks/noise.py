"""The noise of the measured column: as it is and as stated, white or coloured, with tones, beside a coarse grid."""

import math

import numpy as np
from annotated_types import Ge
from scipy.signal import periodogram

from models.checks.estimators import Array, grid_step, told_noise
from models.checks.finding import Findings
from models.checks.sensor import without_outliers
from models.checks.settings import SET
from models.checks.usable import usable
from models.checks.view import View
from models.rigs.schema import bounds
from models.rigs.tables import Noise


def _key(view: View) -> str:
    """The key of `[noise]` with which a rig file states the noise of the measured column; empty where it has none."""
    stem, _, unit = view.measured.partition("_")
    return f"{stem}_std_{unit}" if view.measured in ("force_N", "position_m", "torque_N_m") else ""


def noise_used(stated: float | None, told: float, span: float, step: float = 0.0) -> float:
    """The noise that fits use: the stated one with what a resolution `step` adds, unless the record is noisier or the
    stated one is absurd beside the `span` of the signal.
    """
    stated = stated if stated is None else math.hypot(stated, step / math.sqrt(12))
    if stated is None or told > SET.noise_off * stated or stated > SET.noise_absurd * span:
        return told
    return stated


def check_noise(view: View) -> Findings:
    """Noise that is not as the rig file states."""
    key, name, unit, span = _key(view), view.measured, view.unit, float(np.ptp(view.y))
    stated = getattr(view.rig.noise, key) if key else None
    if stated is None or len(view.y) < 200:
        return
    told = told_noise(view.y[usable(view)], view.kind.vibrates, stated)
    how = "the quietest tenth of the spectrum" if view.kind.vibrates else "second differences in the quieter stretches"
    lower, _ = bounds(Noise, key)
    small = isinstance(lower, Ge) and told < lower.ge  # type: ignore[operator]
    remedy = f"leave {key} out of [noise]" if small else f"[noise] {key} = {told:.2g}"
    if told > SET.noise_off * stated:
        said = (
            f"the noise of {name} is {told:.3g} {unit}, {told / stated:.2g} times the stated {stated:.3g} {unit}; the"
            " fits use what was found"
        )
        yield view.notes("noise_stated", said, how, remedy)
    elif stated > SET.noise_absurd * span:
        said = (
            f"the stated noise of {stated:.3g} {unit} is as large as the signal itself, which spans {span:.3g} {unit};"
            f" the fits use {told:.3g} {unit}, which was found"
        )
        yield view.weakens("noise_stated", said, "the stated noise beside the span of the column", remedy)
    elif told < stated / (2 * SET.noise_off):
        said = (
            f"white noise of {name} is {told:.3g} {unit}, less than the stated {stated:.3g} {unit}: it is filtered, or"
            " better than its data sheet; the stated one is used"
        )
        yield view.notes("noise_stated", said, how, f"{remedy}, where the sensor is that good")


def check_resolution(view: View) -> Findings:
    """Values of the measured column on a grid that is coarse beside the noise: a converter or a camera."""
    step, unit, key = grid_step(view.y), view.unit, _key(view)
    coarse = view.noise > 0 or np.mean(np.diff(view.y) == 0) >= SET.coarse_equal
    if step > SET.coarse * view.noise and coarse:
        levels, value = round(float(np.ptp(view.y)) / step) + 1, step / np.sqrt(12)
        yield view.finding(
            "weakens" if levels < SET.few_levels else "note",
            "resolution",
            f"{view.measured} has a resolution of {step:.3g} {unit}, {levels} levels over its range: coarser than its"
            f" noise, so the noise counts as at least {value:.2g} {unit}",
            "all values lie on one grid",
            f"[noise] {key} = {value:.2g}" if key else "record with a finer resolution",
        )


def check_colour(view: View) -> Findings:
    """Noise of the measured column that goes on from sample to sample: a sensor that filters."""
    if view.noise == 0:
        return
    view = View(without_outliers(view), view.rig)
    told = ((view.windows_at_rest(samples), fewest, least) for samples, fewest, least in SET.colour_windows)
    rows, least = next(((rows, least) for rows, fewest, least in told if len(rows) >= fewest), (np.zeros((0, 1)), 0.0))
    if rows.size and (correlation := _correlation(view, rows)) >= max(least, SET.colour_sure / np.sqrt(rows.size)):
        yield view.notes(
            "noise_coloured",
            f"the noise of {view.measured} goes on from sample to sample (correlation {correlation:.2f}): the sensor or"
            " its amplifier filters; a filter's delay looks like a late sensor",
            f"correlation of neighbours over {rows.size} samples at rest",
            "log the sensor unfiltered, or state its delay: [clock] offset_s",
            rows="at rest",
        )


def _correlation(view: View, rows: Array) -> float:
    """Correlation of neighbouring samples of `rows` (n, m) without the record's tones and what a parabola follows."""
    at = np.arange(rows.shape[1])
    waves = [turned(2 * np.pi * hertz * view.dt * at) for hertz, _ in tones(view) for turned in (np.sin, np.cos)]
    basis, _ = np.linalg.qr(np.column_stack([np.vander(at, 3).astype(float), *waves]))
    left = rows - rows @ basis @ basis.T
    power = float(np.sum(left**2))
    lost = basis.shape[1] / len(at)  # white noise less what a basis follows is correlated by about minus this
    return float(np.sum(left[:, 1:] * left[:, :-1])) / power + lost if power > 0 else 0.0


def check_tones(view: View) -> Findings:
    """Tones on the measured column that stay the same whatever the motion does: mains hum and ringing."""
    unit, n, speeds = view.measured.rsplit("_", 1)[1], len(view.y), np.abs(view.speed[view.moves])
    steady = len(speeds) > 0 and float(np.percentile(speeds, 90)) < SET.tone_speeds * float(np.percentile(speeds, 10))
    own = steady or not view.kind.imposed  # stick-slip at one speed, or the tone of a capsule on its spring
    shown = []
    for hertz, amplitude in tones(view):
        near = (abs(hertz - m) < max(SET.near * m, 1.5 * SET.tone_parts / n / view.dt) for m in SET.mains_hz)
        mains = any(near)
        if mains or not own:
            shown.append(f"{hertz:.4g} Hz ({amplitude:.2g} {unit}{', mains' if mains else ''})")
    if shown:
        yield view.notes(
            "tone",
            f"{view.measured} carries tones, whatever the motion does: {', '.join(shown)}",
            f"lines more than {SET.tone:g} times their neighbourhood in each of {SET.tone_parts} stretches, or mains at"
            " rest",
            "mains: shield and ground the sensor, or average over whole periods; ringing: damp the mount",
        )


def tones(view: View) -> list[tuple[float, float]]:
    """Frequency in Hz and amplitude of each tone of the measured column that every stretch of the record shows, and of
    mains that its rests show.
    """
    found = _throughout(view)
    return found + [mains for mains in _at_rest(view) if all(abs(mains[0] - hertz) > 2.0 for hertz, _ in found)]


def _at_rest(view: View) -> list[tuple[float, float]]:
    """Mains in what a parabola leaves of the windows at rest: a power there by far over white noise's, and over that of
    frequencies beside it.
    """
    rows, at = view.windows_at_rest(SET.mains_window), np.arange(SET.mains_window)
    if len(rows) < SET.mains_windows:
        return []
    slow, _ = np.linalg.qr(np.vander(at, 3).astype(float))
    left = rows - rows @ slow @ slow.T

    def power(frequency: float) -> float:
        turn = 2 * np.pi * frequency * view.dt * at
        wave = np.column_stack([np.sin(turn), np.cos(turn)])
        wave, _ = np.linalg.qr(wave - slow @ (slow.T @ wave))
        return float(np.mean(np.sum((left @ wave) ** 2, axis=1)))

    found = []
    for mains in (mains for mains in SET.mains_hz if 1.3 * mains * view.dt < 0.5):
        own, beside = power(mains), max(power(0.75 * mains), power(1.25 * mains))
        white = 2 * (float(np.mean(np.sum(left**2, axis=1))) - own) / (SET.mains_window - 5)
        if own > (1 + SET.mains_sure / np.sqrt(len(rows))) * white and own > SET.mains_over * beside:
            found.append((mains, float(np.sqrt(2 * (own - white) / SET.mains_window))))
    return found


def _throughout(view: View) -> list[tuple[float, float]]:
    """The three strongest lines at most that stand out in the spectrum of every stretch of the record."""
    n = len(view.y) // SET.tone_parts
    if n < 128 or view.kind.vibrates:
        return []
    pieces = np.diff(view.y[: n * SET.tone_parts].reshape(SET.tone_parts, n), axis=1)
    frequency, power = periodogram(pieces, 1 / view.dt, window="hann", axis=1)
    width, step = max(5, n // 40), frequency[1] - frequency[0]
    level = np.array([np.median(power[:, max(0, k - width) : k + width + 1], axis=1) for k in range(power.shape[1])]).T
    ratio = np.min(power / np.maximum(level, 1e-300), axis=0)
    ratio[frequency < SET.tone_lowest_hz] = 0.0
    found: list[tuple[float, float]] = []
    while len(found) < 3 and np.max(ratio) >= SET.tone:
        k = int(np.argmax(ratio))
        rms = np.sqrt(np.median(np.sum((power - level)[:, max(0, k - 3) : k + 4], axis=1)) * step)
        found.append((float(frequency[k]), float(np.sqrt(2) * rms / (2 * np.sin(np.pi * frequency[k] * view.dt)))))
        ratio[np.abs(frequency - frequency[k]) < max(SET.tone_wide * frequency[k], 6 * step)] = 0.0
    return found
