"""Tones that stay the same whatever the motion does: mains and ringing."""

import numpy as np
from scipy.signal import periodogram

from models.checks.finding import RecordFinding
from models.checks.settings import SET
from models.checks.view import View


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
    if not view.timed:
        return []
    rows = view.windows_at_rest(SET.mains_window)
    hertz = [mains for mains in SET.mains_hz if 1.3 * mains * view.dt < 0.5]
    if len(rows) < SET.mains_windows or not hertz:
        return []
    at = np.arange(SET.mains_window)
    slow, _ = np.linalg.qr(np.vander(at, 3).astype(float))
    left = rows - rows @ slow @ slow.T

    def power(frequency: float) -> float:
        turn = 2 * np.pi * frequency * view.dt * at
        wave = np.column_stack([np.sin(turn), np.cos(turn)])
        wave, _ = np.linalg.qr(wave - slow @ (slow.T @ wave))
        return float(np.mean(np.sum((left @ wave) ** 2, axis=1)))

    found = []
    for mains in hertz:
        own, beside = power(mains), max(power(0.75 * mains), power(1.25 * mains))
        white = 2 * (float(np.mean(np.sum(left**2, axis=1))) - own) / (SET.mains_window - 5)
        if own > (1 + SET.mains_sure / np.sqrt(len(rows))) * white and own > SET.mains_over * beside:
            found.append((mains, float(np.sqrt(2 * (own - white) / SET.mains_window))))
    return found


def _throughout(view: View) -> list[tuple[float, float]]:
    n = len(view.y) // SET.tone_parts
    if not view.timed or n < 128 or view.kind.vibrates:
        return []
    pieces = np.diff(view.y[: n * SET.tone_parts].reshape(SET.tone_parts, n), axis=1)
    frequency, power = periodogram(pieces, 1 / view.dt, window="hann", axis=1)
    width = max(5, n // 40)
    level = np.array([np.median(power[:, max(0, k - width) : k + width + 1], axis=1) for k in range(power.shape[1])]).T
    ratio = np.min(power / np.maximum(level, 1e-300), axis=0)
    ratio[frequency < SET.tone_lowest_hz] = 0.0
    found: list[tuple[float, float]] = []
    while len(found) < 3:
        k = int(np.argmax(ratio))
        if ratio[k] < SET.tone:
            break
        near = slice(max(0, k - 3), k + 4)
        rms = np.sqrt(np.median(np.sum((power - level)[:, near], axis=1)) * (frequency[1] - frequency[0]))
        found.append((float(frequency[k]), float(np.sqrt(2) * rms / (2 * np.sin(np.pi * frequency[k] * view.dt)))))
        ratio[
            np.abs(frequency - frequency[k]) < max(SET.tone_wide * frequency[k], 6 * (frequency[1] - frequency[0]))
        ] = 0.0
    return found


def check_tones(view: View) -> list[RecordFinding]:
    """Mains hum and ringing on the measured column."""
    unit, n = view.measured.rsplit("_", 1)[1], len(view.y)
    speeds = np.abs(view.speed[view.moves]) if view.timed else np.zeros(0)
    steady = len(speeds) > 0 and float(np.percentile(speeds, 90)) < SET.tone_speeds * float(np.percentile(speeds, 10))
    own = steady or not view.kind.imposed  # stick-slip at one speed, or the tone of a capsule on its spring
    shown = []
    for hertz, amplitude in tones(view):
        mains = next(
            (m for m in SET.mains_hz if abs(hertz - m) < max(SET.near * m, 1.5 * SET.tone_parts / n / view.dt)), None
        )
        if mains is not None or not own:
            shown.append(f"{hertz:.4g} Hz ({amplitude:.2g} {unit}{', mains' if mains else ''})")
    if not shown:
        return []
    return [
        view.finding(
            "tone",
            "note",
            f"{view.measured}, throughout",
            f"{view.measured} carries tones, whatever the motion does: {', '.join(shown)}",
            f"lines more than {SET.tone:g} times their neighbourhood"
            f" in each of {SET.tone_parts} stretches, or mains at rest",
            "mains: shield and ground the sensor, or average over whole periods; ringing: damp the mount",
        )
    ]
