"""Channels with several clocks on one: interpolated linearly between samples, never extrapolated."""

from collections.abc import Mapping, Sequence

import numpy as np

from hil.formats.channels import Array, Channel, RefusedError
from models.rigs.columns import TIME


def increasing(times: Array) -> np.ndarray:
    """Which of the times are later than all before them."""
    kept = np.ones(times.shape, dtype=bool)
    kept[1:] = times[1:] > np.maximum.accumulate(times)[:-1]
    return kept


def mean_before(rows: Array, times: Array, levels: Array) -> Array:
    """Mean of the piecewise constant `levels` since the previous row; the first interval is as long as the second."""
    area = np.concatenate([[0.0], np.cumsum(levels[:-1] * np.diff(times))])
    last = np.array([rows[0] - (rows[1] - rows[0]), *rows[:-1]]) if len(rows) > 1 else rows - 1e-3
    upto = np.interp(rows, times, area) + np.maximum(rows - times[-1], 0.0) * levels[-1]
    before = np.interp(last, times, area) + np.maximum(last - times[-1], 0.0) * levels[-1]
    return np.asarray((upto - before) / (rows - last))


_MOST_PARTS = 100  # parts of a gap


def between(rows: Array, times: Array) -> tuple[Array, np.ndarray]:
    """The times `rows` with further ones evenly between them, as close as the changes of a held level usually are
    (`times`; without any, no further ones), and a mask of the `rows` among them.
    """
    if len(rows) < 2 or len(times) < 2:
        return rows, np.ones(len(rows), dtype=bool)
    lasts = float(np.median(np.diff(times)))
    parts = np.clip(np.round(np.diff(rows) / lasts), 1, _MOST_PARTS).astype(int)
    at = np.concatenate([[0], np.cumsum(parts)])
    given = np.zeros(at[-1] + 1, dtype=bool)
    given[at] = True
    return np.interp(np.arange(at[-1] + 1), at, rows), given


def one_clock(
    samples: Mapping[str, tuple[Array, Array]], rows_of: str, held: Sequence[str] = ()
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns at the times of `rows_of`, with `t_s`, from (times, values) of each, and notes on the resampling. Other
    columns are interpolated linearly; a `held` one is the mean of its levels since the previous row, with further rows
    if it changes more often. Rows outside the common time span are left out.
    """
    notes, clean = list[str](), dict[str, tuple[Array, Array]]()
    for name, (times, values) in samples.items():
        good = np.isfinite(times) & np.isfinite(values)
        good[good] = increasing(times[good])
        if not good.any():
            raise RefusedError(f"channel of {name} must have samples at increasing times; got none")
        if not good.all():
            notes.append(f"{name}: {np.count_nonzero(~good)} samples without a number or a later time left out")
        clean[name] = times[good], values[good]
    rows = clean[rows_of][0]
    spans = [(times[0], times[-1]) for name, (times, _) in clean.items()]
    start, end = max(first for first, _ in spans), min(last for _, last in spans)
    inside = (rows >= start) & (rows <= end)
    levels = next((clean[name][0] for name in samples if name in held and name != rows_of), rows[:0])
    at, given = between(rows[inside], levels)
    columns: dict[str, Array] = {TIME: at}
    for name, (times, values) in clean.items():
        if name == rows_of:
            columns[name] = np.full(len(at), np.nan)
            columns[name][given] = values[inside]
        elif name in held:
            columns[name] = mean_before(at, times, values) if len(at) else at
        else:
            columns[name] = np.interp(at, times, values)
        if name != rows_of:
            how = "averaged since the row before" if name in held else "interpolated"
            where = f"at the times of {rows_of}" + ("" if given.all() else " and evenly between them")
            notes.append(f"{name}: {len(times)} samples {how} {where}")
    if not inside.all():
        notes.append(f"{np.count_nonzero(~inside)} rows outside the time that all columns share left out")
    return columns, tuple(notes)


def by_clock(channels: Sequence[Channel]) -> list[tuple[str, Array, list[Channel]]]:
    """Channels by (group, times (n,)), without `t_s`: it is the clock of channels without one, else their count is."""
    clock = next((channel.values for channel in channels if channel.heading.name == TIME), None)
    found: list[tuple[str, Array, list[Channel]]] = []
    for channel in (channel for channel in channels if channel.heading.name != TIME):
        own = channel.time_s if channel.time_s is not None else clock
        times = own if own is not None else np.arange(len(channel.values), dtype=float)
        for group, other, members in found:
            if group == channel.heading.group and np.array_equal(other, times):
                members.append(channel)
                break
        else:
            found.append((channel.heading.group, times, [channel]))
    return found


def one_table(channels: Sequence[Channel]) -> dict[str, Array]:
    """All channels as columns at the union of their times `t_s`, NaN for missing samples."""
    if all(channel.time_s is None for channel in channels):
        lengths = {channel.heading.name: len(channel.values) for channel in channels}
        if len(set(lengths.values())) > 1:
            raise RefusedError(f"columns must have one length; got {lengths}"[:300])
        return {channel.heading.name: channel.values for channel in channels}
    if any(channel.time_s is None and channel.heading.name != TIME for channel in channels):
        raise RefusedError("columns without a clock must not stand beside channels with one: give --rig or --kind")
    groups = by_clock(channels)
    times = np.unique(np.concatenate([time_s for _, time_s, _ in groups]))
    columns = {TIME: times}
    for _, time_s, members in groups:
        at = np.searchsorted(times, time_s)
        for channel in members:
            column = np.full(times.shape, np.nan)
            column[at] = channel.values
            columns[channel.heading.name] = column
    return columns
