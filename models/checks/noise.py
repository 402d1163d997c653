"""The noise of the measured column: estimated and stated, white or coloured, with tones, on a coarse grid."""

import math

import numpy as np
import scipy
from annotated_types import Ge

from models.checks.estimators import Array, estimated_noise, grid_step
from models.checks.finding import Findings
from models.checks.sensor import without_outliers
from models.checks.settings import SET
from models.checks.usable import usable
from models.checks.view import TEXT, View, once
from models.rigs.schema import bounds
from models.rigs.tables import Noise


def _key(view: View) -> str:
    """The key of `[noise]` with which a rig file states the noise of the measured column; empty where it has none."""
    stem, _, unit = view.measured.partition("_")
    return f"{stem}_std_{unit}" if view.measured in ("force_N", "position_m", "torque_N_m") else ""


def noise_used(stated: float | None, estimated: float, span: float, step: float = 0.0) -> float:
    """The noise that fits use: as stated with that of a `step`, unless the record is noisier or it is absurd."""
    stated = stated if stated is None else math.hypot(stated, step / math.sqrt(12))
    if stated is None or estimated > SET.noise_off * stated or stated > SET.noise_absurd * span:
        return estimated
    return stated


def check_noise(view: View) -> Findings:
    """Noise that is not as the rig file states."""
    view = view.unbroken
    key, span = _key(view), float(np.ptp(view.y))
    stated = getattr(view.rig.noise, key) if key else None
    if stated is None or len(view.y) < 200:
        return
    own, spectral = estimated_noise(view.y[usable(view)], view.kind.vibrates, stated), view.kind.vibrates
    lower, _ = bounds(Noise, key)
    small = isinstance(lower, Ge) and own < lower.ge  # type: ignore[operator]
    values = {
        "noise": view.of_measured(own),
        "stated": view.of_measured(stated),
        "line": TEXT("noise_line.leave_out", key=key) if small else f"[noise] {key} = {own:.2g}",
    }
    if own > SET.noise_off * stated:
        yield view.notes("noise_stated.larger", ratio=own / stated, spectral=spectral, **values)
    elif stated > SET.noise_absurd * span:
        yield view.weakens("noise_stated.absurd", span=view.of_measured(span), **values)
    elif own < stated / (2 * SET.noise_off):
        yield view.notes("noise_stated.smaller", spectral=spectral, **values)


def check_resolution(view: View) -> Findings:
    """Values of the measured column on a grid that is coarse beside the noise: a converter or a camera."""
    step, key = grid_step(view.y), _key(view)
    coarse = view.noise > 0 or np.mean(np.diff(view.y) == 0) >= SET.coarse_equal
    if step > SET.coarse * view.noise and coarse:
        levels, noise = round(float(np.ptp(view.y)) / step) + 1, step / math.sqrt(12)
        yield view.finding(
            "weakens" if levels < SET.few_levels else "note",
            "resolution",
            step=view.of_measured(step),
            levels=levels,
            noise=view.of_measured(noise),
            line=f"[noise] {key} = {noise:.2g}" if key else TEXT("noise_line.finer"),
        )


def check_colour(view: View) -> Findings:
    """Noise of the measured column that is correlated from sample to sample: a sensor that filters."""
    if view.noise == 0:
        return
    view = view.of(without_outliers(view))
    found = ((view.windows_at_rest(samples), fewest, least) for samples, fewest, least in SET.colour_windows)
    rows, least = next(((rows, least) for rows, fewest, least in found if len(rows) >= fewest), (np.zeros((0, 1)), 0.0))
    if rows.size and (correlation := _correlation(view, rows)) >= max(least, SET.colour_sure / np.sqrt(rows.size)):
        yield view.notes("noise_coloured", rows="at rest", correlation=correlation, n=rows.size)


def _correlation(view: View, rows: Array) -> float:
    """Correlation of neighbouring samples of `rows` (n, m), less the record's tones and a parabola."""
    at = np.arange(rows.shape[1])
    waves = [turned(2 * np.pi * hertz * view.dt * at) for hertz, _ in tones(view) for turned in (np.sin, np.cos)]
    basis, _ = np.linalg.qr(np.column_stack([np.vander(at, 3).astype(float), *waves]))
    left = rows - rows @ basis @ basis.T
    power = float(np.sum(left**2))
    lost = basis.shape[1] / len(at)  # white noise less what a basis follows is correlated by about minus this
    return float(np.sum(left[:, 1:] * left[:, :-1])) / power + lost if power > 0 else 0.0


def check_tones(view: View) -> Findings:
    """Tones on the measured column that stay the same whatever the motion does: mains hum and ringing."""
    n, speeds = len(view.y), np.abs(view.speed[view.moves])
    steady = len(speeds) > 0 and float(np.percentile(speeds, 90)) < SET.tone_speeds * float(np.percentile(speeds, 10))
    own = steady or not view.kind.imposed  # stick-slip at one speed, or the tone of a capsule on its spring
    shown = []
    for hertz, amplitude in tones(view):
        near = (abs(hertz - m) < max(SET.near * m, 1.5 * SET.tone_parts / n / view.dt) for m in SET.mains_hz)
        mains = any(near)
        if mains or not own:
            case = "tone.mains" if mains else "tone.line"
            shown.append(TEXT(case, hertz=hertz, amplitude=view.of_measured(amplitude)))
    if shown:
        yield view.notes("tone", tones=shown, ratio=SET.tone, parts=SET.tone_parts)


def tones(view: View) -> list[tuple[float, float]]:
    """Frequency in Hz and amplitude of each tone that all stretches of the measured column show, of mains at rest."""
    found = _throughout(view)
    return found + [mains for mains in _at_rest(view) if all(abs(mains[0] - hertz) > 2.0 for hertz, _ in found)]


def _at_rest(view: View) -> list[tuple[float, float]]:
    """Mains in what a parabola leaves of the windows at rest: far over white noise and over frequencies beside it."""
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


@once
def _throughout(view: View) -> list[tuple[float, float]]:
    """The three strongest lines at most that stand out in the spectrum of every stretch of the record."""
    n = len(view.y) // SET.tone_parts
    if n < 128 or view.kind.vibrates:
        return []
    pieces = np.diff(view.y[: n * SET.tone_parts].reshape(SET.tone_parts, n), axis=1)
    frequency, power = scipy.signal.periodogram(pieces, 1 / view.dt, "hann")
    step, around = frequency[1], 2 * max(5, n // 40) + 1
    level = np.array([scipy.ndimage.median_filter(row, around) for row in power])
    ratio = np.min(power / np.maximum(level, 1e-300), axis=0) * (frequency >= SET.tone_lowest_hz)
    found: list[tuple[float, float]] = []
    while len(found) < 3 and np.max(ratio) >= SET.tone:
        k = int(np.argmax(ratio))
        rms = np.sqrt(np.median(np.sum((power - level)[:, max(0, k - 3) : k + 4], axis=1)) * step)
        found.append((float(frequency[k]), float(np.sqrt(2) * rms / (2 * np.sin(np.pi * frequency[k] * view.dt)))))
        ratio[np.abs(frequency - frequency[k]) < max(SET.tone_wide * frequency[k], 6 * step)] = 0.0
    return found
